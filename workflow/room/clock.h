#pragma once
// The time in a treatment room. All code that waits uses a Clock, so that a test can let hours pass at once.

#include <chrono>
#include <filesystem>
#include <thread>

namespace isoshift {

class Clock {
 public:
  using Time = std::chrono::steady_clock::time_point;

  virtual ~Clock() = default;

  // For durations while the program runs. Nobody can set this time.
  virtual Time now() const = 0;
  // For the ages of files, which outlive the program.
  virtual std::filesystem::file_time_type file_time() const = 0;
  virtual void wait(std::chrono::milliseconds length) = 0;
};

class SystemClock : public Clock {
 public:
  Time now() const override { return Time::clock::now(); }
  std::filesystem::file_time_type file_time() const override { return std::filesystem::file_time_type::clock::now(); }
  void wait(std::chrono::milliseconds length) override { std::this_thread::sleep_for(length); }
};

}  // namespace isoshift
