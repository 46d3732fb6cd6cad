#pragma once
// What long work tells whoever waits for it. A terminal shows it as a bar and lines; a worker process and most tests do
// not look.

#include <string>
#include <string_view>

namespace isoshift {

class Observer {
 public:
  virtual ~Observer() = default;

  // How much of a step is done, 0 to 1. The next step, or 1, ends it.
  virtual void progress(std::string_view /*step*/, double /*share*/) {}
  void progress(std::string_view step, std::size_t done, std::size_t total) {
    progress(step, static_cast<double>(done) / static_cast<double>(total));
  }

  // What is the case now; the next line takes its place. Not for a log.
  virtual void show(std::string_view /*line*/) {}

  // One line for a log.
  virtual void say(std::string_view /*line*/) {}
};

}  // namespace isoshift
