#include "base/local_time.h"

#include <fmt/chrono.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <ctime>
#include <iomanip>
#include <sstream>

namespace isoshift {

std::string local_time() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%S%z}",
                     fmt::localtime(std::chrono::system_clock::to_time_t(std::chrono::system_clock::now())));
}

std::optional<double> utc_seconds_at(const std::string& local_time) {
  // get_time() reads no offset from UTC.
  constexpr std::size_t kOffsetSize = 5;  // "+0100"
  if (local_time.size() < kOffsetSize) return std::nullopt;
  const std::string offset = local_time.substr(local_time.size() - kOffsetSize);
  const bool is_offset = (offset[0] == '+' || offset[0] == '-') &&
                         std::all_of(offset.begin() + 1, offset.end(), [](unsigned char c) { return std::isdigit(c); });
  std::tm parts{};
  std::istringstream text(local_time.substr(0, local_time.size() - kOffsetSize));
  text >> std::get_time(&parts, "%Y-%m-%dT%H:%M:%S");
  if (!is_offset || !text || text.peek() != std::istringstream::traits_type::eof()) return std::nullopt;
  const int hours_minutes = std::stoi(offset.substr(1));
  const int east_s = 3600 * (hours_minutes / 100) + 60 * (hours_minutes % 100);
  return static_cast<double>(::timegm(&parts)) - (offset[0] == '+' ? east_s : -east_s);
}

std::optional<double> seconds_at(const std::string& time) {
  std::tm parts{};
  std::istringstream text(time);
  text >> std::get_time(&parts, "%Y-%m-%d %H:%M:%S");
  return text ? std::optional(static_cast<double>(::timegm(&parts))) : std::nullopt;
}

}  // namespace isoshift
