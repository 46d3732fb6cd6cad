#pragma once
// Sends what was released to the peers of a watch file.

#include <map>
#include <stop_token>
#include <string>

#include "base/backoff.h"
#include "io/config/watch_file.h"
#include "workflow/observer.h"
#include "workflow/room/results_tree.h"

namespace isoshift {

// What could not be sent is tried again, after longer and longer times.
class Deliverer {
 public:
  explicit Deliverer(const WatchFile& watch) : tree_(watch.results), watch_(watch) {}

  // Tries all that is due, until it is stopped. Only for whoever holds the lock of the tree.
  void deliver(const std::stop_token& stop, Observer& observer);

 private:
  ResultsTree tree_;
  const WatchFile& watch_;
  std::map<std::string, Backoff> pauses_;  // of peers, and of objects that one refuses
};

}  // namespace isoshift
