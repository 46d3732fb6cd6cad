#include "cli/console.h"

#include <fmt/format.h>

#include <algorithm>

namespace isoshift {
namespace {

constexpr std::chrono::milliseconds kQuiet{500};
constexpr int kBarWidth = 30;

}  // namespace

ProgressBar::ProgressBar(Console& console, std::string what)
    : console_(console), what_(std::move(what)), begin_(std::chrono::steady_clock::now()) {}

ProgressBar::~ProgressBar() {
  if (console_.err_is_terminal && shown_percent_ >= 0) console_.err << "\r\x1b[K" << std::flush;
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
    console_.err << fmt::format("\r\x1b[K{:<16} [{:<{}}] {:3} %{}", what_,
                                std::string(static_cast<std::size_t>(filled), '#'), kBarWidth, percent,
                                time_left(share))
                 << std::flush;
  } else if (percent / 25 > std::max(0, shown_percent_) / 25) {
    console_.err << fmt::format("{}: {} %{}\n", what_, percent / 25 * 25, time_left(share)) << std::flush;
  }
  shown_percent_ = percent;
}

void print_warnings(const std::vector<std::string>& warnings, Console& console) {
  for (const std::string& warning : warnings) console.err << "warning: " << warning << "\n";
}

}  // namespace isoshift
