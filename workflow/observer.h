#pragma once
// Receives progress and messages of long work. A terminal shows them as a bar and as lines; a worker process and most
// tests ignore them.

#include <string>
#include <string_view>

namespace isoshift {

class Observer {
 public:
  virtual ~Observer() = default;

  // The share of a step that is done, from 0 to 1. A share of 1 ends the step, and so does the next step.
  virtual void progress(std::string_view /*step*/, double /*share*/) {}
  void progress(std::string_view step, std::size_t done, std::size_t total) {
    progress(step, static_cast<double>(done) / static_cast<double>(total));
  }

  // The current state, which the next call replaces. Not for a log.
  virtual void show(std::string_view /*line*/) {}

  // One line for a log.
  virtual void say(std::string_view /*line*/) {}
};

}  // namespace isoshift
