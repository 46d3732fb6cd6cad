#pragma once

#include <string_view>

namespace isoshift {

// Of a test of a commissioning.
enum class Outcome { kPassed, kFailed, kUntested };

inline std::string_view to_string(Outcome outcome) {
  switch (outcome) {
    case Outcome::kPassed: return "passed";
    case Outcome::kFailed: return "FAILED";
    case Outcome::kUntested: return "untested";
  }
  return "";
}

}  // namespace isoshift
