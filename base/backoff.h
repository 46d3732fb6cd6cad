#pragma once
// When to try again what failed: after longer and longer times.

#include <algorithm>
#include <chrono>

namespace isoshift {

class Backoff {
 public:
  using Clock = std::chrono::steady_clock;

  Backoff(std::chrono::seconds first, std::chrono::seconds longest) : first_(first), longest_(longest) {}

  bool is_due() const { return next_ <= Clock::now(); }

  // It failed. How long it now waits: twice as long as before.
  std::chrono::seconds fail() {
    length_ = std::clamp(2 * length_, first_, longest_);
    next_ = Clock::now() + length_;
    return length_;
  }

 private:
  std::chrono::seconds first_, longest_, length_{0};
  Clock::time_point next_;
};

}  // namespace isoshift
