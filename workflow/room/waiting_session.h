#pragma once

#include <string>

namespace isoshift {

// A session without a result, with the reason.
struct WaitingSession {
  std::string name, patient_id;
  std::string acquired;  // labels and times of its X-rays
  std::string last;      // when its last X-ray was acquired, "2026-03-01 10:15:00"; empty: unknown
  std::string why;
  bool has_failed = false;
  bool operator==(const WaitingSession&) const = default;
};

}  // namespace isoshift
