#pragma once
// Where a command writes: results to `out`, progress and warnings to `err`.

#include <chrono>
#include <cstddef>
#include <optional>
#include <ostream>
#include <string>
#include <string_view>
#include <vector>

#include "workflow/observer.h"

namespace isoshift {

struct Console {
  std::ostream& out;
  std::ostream& err;
  bool err_is_terminal = false;
};

// Shows the progress of long work: on a terminal a bar that redraws itself, elsewhere a line per quarter. Both show the
// time left if it is long. Work that ends within half a second shows nothing.
class ProgressBar {
 public:
  ProgressBar(Console& console, std::string what);
  ~ProgressBar();  // ends the bar's line
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  void update(double share);
  void update(std::size_t done, std::size_t total) { update(static_cast<double>(done) / static_cast<double>(total)); }

 private:
  std::string time_left(double share) const;

  Console& console_;
  std::string what_;
  std::chrono::steady_clock::time_point begin_;
  int shown_percent_ = -1;
};

// Shows a bar for each step of the work, and the lines that the work reports.
class ConsoleObserver : public Observer {
 public:
  explicit ConsoleObserver(Console& console) : console_(console) {}
  ~ConsoleObserver() override;

  using Observer::progress;
  void progress(std::string_view step, double share) override;
  void show(std::string_view line) override;
  void say(std::string_view line) override;

 private:
  Console& console_;
  std::string step_;
  std::optional<ProgressBar> bar_;
  bool shows_line_ = false;
};

void print_warnings(const std::vector<std::string>& warnings, Console& console);

// Exit statuses, the same for every command.
inline constexpr int kExitAccepted = 0;
inline constexpr int kExitFailed = 1;
inline constexpr int kExitUsage = 2;
inline constexpr int kExitReview = 3;
inline constexpr int kExitRejected = 4;

}  // namespace isoshift
