#pragma once
// A message between processes is one line.

#include <gtest/gtest.h>

#include <string>

namespace isoshift {

inline std::string line_without_end(std::string line) {
  EXPECT_EQ(line.find('\n'), line.size() - 1) << "one message, one line";
  line.pop_back();
  return line;
}

}  // namespace isoshift
