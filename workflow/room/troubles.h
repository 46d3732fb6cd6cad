#pragma once
// What does not work now: a full disk, a server that is down. It ends nothing, and is tried again.

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

  // Does the work. The observer is told of an Error when it is a new one, and when the work goes on.
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
    for (const auto& [what, why] : why_) lines.push_back(fmt::format("{}: {}", what, why));
    return lines;
  }

 private:
  Observer& observer_;
  std::map<std::string, std::string> why_;  // by what is tried
};

}  // namespace isoshift
