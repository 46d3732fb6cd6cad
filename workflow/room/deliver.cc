#include "workflow/room/deliver.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>
#include <utility>

namespace isoshift {

bool Deliverer::is_due(const std::string& what) const {
  const auto pause = pauses_.find(what);
  return pause == pauses_.end() || pause->second.is_due(clock_.now());
}

std::chrono::seconds Deliverer::put_off(const std::string& what) {
  constexpr std::chrono::seconds kFirst(2), kLongest(300);
  return pauses_.try_emplace(what, kFirst, kLongest).first->second.fail(clock_.now());
}

void Deliverer::refuse(const std::string& session, const std::string& why, Observer& observer) {
  if (std::exchange(refused_[session], why) != why)
    observer.say(fmt::format("warning: session {}: not sent: {}", session, why));
}

void Deliverer::deliver(const std::stop_token& stop, const std::function<bool(const std::string& session)>& may_be_sent,
                        Observer& observer) {
  const ResultsTree::Pending pending = tree_.pending();
  for (const auto& [session, why] : pending.refused) refuse(session, why, observer);
  // A peer that is not due now may be due later in this loop: then it would receive the older releases last.
  std::set<std::string> not_due;
  for (const Delivery& delivery : pending.deliveries) {
    if (stop.stop_requested()) return;
    if (!is_due(delivery.peer)) not_due.insert(delivery.peer);
    if (not_due.contains(delivery.peer) || !may_be_sent(delivery.session)) continue;
    deliver(delivery, observer);
    if (!is_due(delivery.peer)) not_due.insert(delivery.peer);
  }
  tree_.write_kept_audit();
}

void Deliverer::deliver(const Delivery& delivery, Observer& observer) {
  const auto& [session, peer_name, object] = delivery;
  const std::string session_key = "/" + session, key = fmt::format("{}/{}/{}", peer_name, session, object.file);
  if (!is_due(session_key) || !is_due(key)) return;
  std::filesystem::path file;
  try {
    file = tree_.checked_file(delivery);
  } catch (const std::exception& error) {
    refuse(session, error.what(), observer);
    put_off(session_key);
    return;
  }
  refused_.erase(session);
  pauses_.erase(session_key);
  const auto fail = [&](const std::string& what, const std::exception& error) {
    observer.say(fmt::format("session {}: {} not sent, tried again in {} s: {}", delivery.session, delivery.object.file,
                             put_off(what).count(), error.what()));
  };
  try {
    const auto peer = std::ranges::find(watch_.peers, peer_name, &DicomPeer::name);
    if (peer == watch_.peers.end()) throw PeerError(fmt::format("peer {}: the watch file does not name it", peer_name));
    const bool may_be_there = tree_.is_in_doubt(delivery);
    tree_.prepare_to_send(delivery);
    const std::string answer = sender_.send(file, object.sha256, *peer, may_be_there);
    tree_.mark_sent(delivery, answer);
    observer.say(fmt::format("session {}: {} sent to {}{}", session, object.file, peer_name,
                             answer.empty() ? "" : ": " + answer));
    pauses_.erase(peer_name);
    pauses_.erase(key);
  } catch (const PeerError& error) {
    fail(delivery.peer, error);
  } catch (const std::exception& error) {
    fail(key, error);
  }
}

}  // namespace isoshift
