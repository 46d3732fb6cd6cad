#pragma once
// Sends what was released to the peers of a watch file.

#include <chrono>
#include <map>
#include <stop_token>
#include <string>

#include "base/backoff.h"
#include "io/config/watch_file.h"
#include "workflow/observer.h"
#include "workflow/room/clock.h"
#include "workflow/room/results_tree.h"
#include "workflow/room/sender.h"

namespace isoshift {

// What could not be sent is tried again, after longer and longer times.
class Deliverer {
 public:
  Deliverer(const WatchFile& watch, Sender& sender, const Clock& clock)
      : tree_(watch.results), watch_(watch), sender_(sender), clock_(clock) {}

  // Tries all that is due, until it is stopped. Only for whoever holds the lock of the tree.
  void deliver(const std::stop_token& stop, Observer& observer);

 private:
  bool is_due(const std::string& what) const;
  std::chrono::seconds put_off(const std::string& what);
  void deliver(const Delivery& delivery, Observer& observer);
  // Says once why nothing of a session is sent.
  void refuse(const std::string& session, const std::string& why, Observer& observer);

  ResultsTree tree_;
  const WatchFile& watch_;
  Sender& sender_;
  const Clock& clock_;
  std::map<std::string, Backoff> pauses_;       // of peers, of objects that a peer refuses, of sessions
  std::map<std::string, std::string> refused_;  // sessions of which nothing is sent, and why
};

}  // namespace isoshift
