#include "base/local_time.h"

#include <fmt/chrono.h>

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
  std::tm parts{};
  char sign = 0;
  int hours_minutes = 0;
  std::istringstream text(local_time);
  text >> std::get_time(&parts, "%Y-%m-%dT%H:%M:%S") >> sign >> hours_minutes;
  if (!text || (sign != '+' && sign != '-')) return std::nullopt;
  const int offset_s = 3600 * (hours_minutes / 100) + 60 * (hours_minutes % 100);
  return static_cast<double>(::timegm(&parts)) - (sign == '+' ? offset_s : -offset_s);
}

std::optional<double> seconds_at(const std::string& time) {
  std::tm parts{};
  std::istringstream text(time);
  text >> std::get_time(&parts, "%Y-%m-%d %H:%M:%S");
  return text ? std::optional(static_cast<double>(::timegm(&parts))) : std::nullopt;
}

}  // namespace isoshift
