#pragma once

#include <string>

namespace isoshift {

// Now, "2026-03-01T10:16:02+0100".
std::string local_time();

}  // namespace isoshift
