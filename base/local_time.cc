#include "base/local_time.h"

#include <fmt/chrono.h>

#include <chrono>

namespace isoshift {

std::string local_time() {
  return fmt::format("{:%Y-%m-%dT%H:%M:%S%z}",
                     fmt::localtime(std::chrono::system_clock::to_time_t(std::chrono::system_clock::now())));
}

}  // namespace isoshift
