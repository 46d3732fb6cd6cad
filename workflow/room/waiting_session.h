#pragma once

#include <string>

#include "workflow/room/session_options.h"

namespace isoshift {

// A session without a result, with the reason.
struct WaitingSession {
  std::string name, patient_id;
  std::string acquired;  // labels and times of its X-rays
  std::string why;
  bool has_failed = false;
  SessionOptions options;  // what a person may choose
  bool operator==(const WaitingSession&) const = default;
};

}  // namespace isoshift
