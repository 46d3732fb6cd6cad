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

std::optional<double> seconds_at(const std::string& time) {
  std::tm parts{};
  std::istringstream text(time);
  text >> std::get_time(&parts, "%Y-%m-%d %H:%M:%S");
  return text ? std::optional(static_cast<double>(::timegm(&parts))) : std::nullopt;
}

}  // namespace isoshift
