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

void ProgressBar::update(double share) {
  const int percent = static_cast<int>(std::clamp(share, 0.0, 1.0) * 100.0);
  if (std::chrono::steady_clock::now() - begin_ < kQuiet || percent <= shown_percent_) return;
  if (console_.err_is_terminal) {
    const int filled = percent * kBarWidth / 100;
    console_.err << fmt::format("\r{:<16} [{:<{}}] {:3} %", what_, std::string(static_cast<std::size_t>(filled), '#'),
                                kBarWidth, percent)
                 << std::flush;
  } else if (percent / 25 > std::max(0, shown_percent_) / 25) {
    console_.err << fmt::format("{}: {} %\n", what_, percent / 25 * 25);
  }
  shown_percent_ = percent;
}

}  // namespace isoshift
