#pragma once
// Real data that lies beside the project, for tests with the label real-data.

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

namespace isoshift {

// $ISOSHIFT_DATA, else ../shared/data beside the project.
inline std::filesystem::path real_data() {
  if (const char* folder = std::getenv("ISOSHIFT_DATA")) return folder;
  return std::filesystem::path(ISOSHIFT_SOURCE_DIR).parent_path() / "shared" / "data";
}

}  // namespace isoshift

// Ends a test that needs the real data where it is absent.
#define ISOSHIFT_NEED_REAL_DATA(part)                             \
  if (!std::filesystem::exists(::isoshift::real_data() / (part))) \
  GTEST_SKIP() << (::isoshift::real_data() / (part)).string() << " is absent; set ISOSHIFT_DATA to its folder"
