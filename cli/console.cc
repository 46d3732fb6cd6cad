#include "cli/console.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "io/report/canvas.h"

namespace isoshift {
namespace {

constexpr std::chrono::milliseconds kQuiet{500};
constexpr int kBarWidth = 30;
constexpr const char* kClearedLine = "\r\x1b[K";

}  // namespace

ProgressBar::ProgressBar(Console& console, std::string what)
    : console_(console), what_(std::move(what)), begin_(std::chrono::steady_clock::now()) {}

ProgressBar::~ProgressBar() {
  if (console_.err_is_terminal && shown_percent_ >= 0) console_.err << kClearedLine << std::flush;
}

// What remains, once there is enough to tell from.
std::string ProgressBar::time_left(double share) const {
  constexpr double kEnough = 0.02, kLongS = 20.0;
  const double elapsed_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  const double left_s = share > kEnough ? elapsed_s * (1.0 - share) / share : 0.0;
  if (left_s < kLongS) return "";
  return left_s < 90.0 ? fmt::format(", about {:.0f} s left", left_s)
                       : fmt::format(", about {:.0f} min left", left_s / 60.0);
}

void ProgressBar::update(double share) {
  const int percent = static_cast<int>(std::clamp(share, 0.0, 1.0) * 100.0);
  if (std::chrono::steady_clock::now() - begin_ < kQuiet || percent <= shown_percent_) return;
  if (console_.err_is_terminal) {
    const int filled = percent * kBarWidth / 100;
    console_.err << fmt::format("{}{:<16} [{:<{}}] {:3} %{}", kClearedLine, what_,
                                std::string(static_cast<std::size_t>(filled), '#'), kBarWidth, percent,
                                time_left(share))
                 << std::flush;
  } else if (percent / 25 > std::max(0, shown_percent_) / 25) {
    console_.err << fmt::format("{}: {} %{}\n", what_, percent / 25 * 25, time_left(share)) << std::flush;
  }
  shown_percent_ = percent;
}

void ConsoleObserver::progress(std::string_view step, double share) {
  if (!bar_ || step != step_) {
    bar_.reset();
    bar_.emplace(console_, std::string(step));
    step_ = step;
  }
  bar_->update(share);
  if (share >= 1.0) bar_.reset();
}

ConsoleObserver::~ConsoleObserver() {
  if (shows_line_) console_.err << "\n";
}

void ConsoleObserver::show(std::string_view line) {
  if (!console_.err_is_terminal) return;
  bar_.reset();
  console_.err << kClearedLine << line << std::flush;
  shows_line_ = true;
}

void ConsoleObserver::say(std::string_view line) {
  bar_.reset();
  if (std::exchange(shows_line_, false)) console_.err << kClearedLine;
  console_.err << printable_lines(line) << "\n" << std::flush;
}

void print_warnings(const std::vector<std::string>& warnings, Console& console) {
  for (const std::string& warning : warnings) console.err << "warning: " << printable_lines(warning) << "\n";
}

}  // namespace isoshift
