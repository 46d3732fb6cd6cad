#include "cli/deliver.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "io/dicom_send.h"

namespace isoshift {

bool Deliverer::is_due(const std::string& what) const {
  const auto pause = pauses_.find(what);
  return pause == pauses_.end() || pause->second.is_due();
}

std::chrono::seconds Deliverer::put_off(const std::string& what) {
  constexpr std::chrono::seconds kFirst(2), kLongest(300);
  return pauses_.try_emplace(what, kFirst, kLongest).first->second.fail();
}

void Deliverer::refuse(const std::string& session, const std::string& why, Console& console) {
  if (std::exchange(refused_[session], why) != why)
    console.err << fmt::format("warning: session {}: not sent: {}\n", session, why);
}

void Deliverer::deliver(const std::stop_token& stop, Console& console) {
  const ResultsTree::Pending pending = tree_.pending();
  for (const auto& [session, why] : pending.refused) refuse(session, why, console);
  for (const Delivery& delivery : pending.deliveries) {
    if (stop.stop_requested()) return;
    deliver(delivery, console);
  }
  tree_.write_kept_audit();
}

void Deliverer::deliver(const Delivery& delivery, Console& console) {
  const auto& [session, peer_name, object] = delivery;
  const std::string session_key = "/" + session, key = fmt::format("{}/{}/{}", peer_name, session, object.file);
  if (!is_due(peer_name) || !is_due(session_key) || !is_due(key)) return;
  std::filesystem::path file;
  try {
    file = tree_.checked_file(delivery);
  } catch (const std::exception& error) {
    refuse(session, error.what(), console);
    put_off(session_key);
    return;
  }
  refused_.erase(session);
  pauses_.erase(session_key);
  const auto fail = [&](const std::string& what, const std::exception& error) {
    console.err << fmt::format("session {}: {} not sent, tried again in {} s: {}\n", delivery.session,
                               delivery.object.file, put_off(what).count(), error.what());
  };
  try {
    const auto peer = std::ranges::find(watch_.peers, peer_name, &DicomPeer::name);
    if (peer == watch_.peers.end()) throw PeerError(fmt::format("peer {}: the watch file does not name it", peer_name));
    const bool may_be_there = tree_.is_in_doubt(delivery);
    tree_.prepare_to_send(delivery);
    const std::string answer = send_object(file, object.sha256, *peer, may_be_there);
    tree_.mark_sent(delivery, answer);
    console.err << fmt::format("session {}: {} sent to {}{}\n", session, object.file, peer_name,
                               answer.empty() ? "" : ": " + answer);
    pauses_.erase(peer_name);
    pauses_.erase(key);
  } catch (const PeerError& error) {
    fail(delivery.peer, error);
  } catch (const std::exception& error) {
    fail(key, error);
  }
}

}  // namespace isoshift
