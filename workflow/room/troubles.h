#pragma once
// The current troubles, such as a full disk or a server that is down. A trouble does not end the program; the work is
// tried again.

#include <fmt/format.h>

#include <functional>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "workflow/observer.h"

namespace isoshift {

class Troubles {
 public:
  explicit Troubles(Observer& observer) : observer_(observer) {}

  // Does the work. Tells the observer of an Error if it differs from the last one, and when the work succeeds again.
  void attempt(const std::string& what, const std::function<void()>& work) {
    try {
      work();
      if (why_.erase(what) > 0) observer_.say(what + ": goes on");
    } catch (const std::exception& error) {
      if (std::exchange(why_[what], error.what()) != error.what())
        observer_.say(fmt::format("{}: {}", what, error.what()));
    }
  }

  std::vector<std::string> lines() const {
    std::vector<std::string> lines;
    lines.reserve(why_.size());
    for (const auto& [what, why] : why_) lines.push_back(fmt::format("{}: {}", what, why));
    return lines;
  }

 private:
  Observer& observer_;
  std::map<std::string, std::string> why_;  // by `what`
};

}  // namespace isoshift
