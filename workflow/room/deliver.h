#pragma once
// Sends released objects to the peers of a watch file.

#include <chrono>
#include <functional>
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

// An object that could not be sent is tried again, after increasing pauses.
class Deliverer {
 public:
  Deliverer(const WatchFile& watch, Sender& sender, const Clock& clock)
      : tree_(watch), watch_(watch), sender_(sender), clock_(clock) {}

  // Tries all deliveries that are due, until `stop` is requested. The caller must hold the lock of the tree.
  // `may_be_sent`: asked for each session, just before.
  void deliver(const std::stop_token& stop, const std::function<bool(const std::string& session)>& may_be_sent,
               Observer& observer);

 private:
  bool is_due(const std::string& what) const;
  std::chrono::seconds put_off(const std::string& what);
  void deliver(const Delivery& delivery, Observer& observer);
  // Reports once why a session is not sent.
  void refuse(const std::string& session, const std::string& why, Observer& observer);

  ResultsTree tree_;
  const WatchFile& watch_;
  Sender& sender_;
  const Clock& clock_;
  std::map<std::string, Backoff> pauses_;       // by peer, by object that a peer refuses, and by session
  std::map<std::string, std::string> refused_;  // reason why a session is not sent, by session
};

}  // namespace isoshift
