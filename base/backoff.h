#pragma once
// When to try again after a failure: after longer and longer pauses.

#include <algorithm>
#include <chrono>

namespace isoshift {

// The caller says what time it is.
class Backoff {
 public:
  using Time = std::chrono::steady_clock::time_point;

  Backoff(std::chrono::seconds first, std::chrono::seconds longest) : first_(first), longest_(longest) {}

  bool is_due(Time now) const { return next_ <= now; }

  // The attempt has failed. Returns the pause until the next attempt: twice the pause before.
  std::chrono::seconds fail(Time now) {
    length_ = std::clamp(2 * length_, first_, longest_);
    next_ = now + length_;
    return length_;
  }

 private:
  std::chrono::seconds first_, longest_, length_{0};
  Time next_;
};

}  // namespace isoshift
