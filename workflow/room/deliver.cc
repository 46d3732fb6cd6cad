#include "workflow/room/deliver.h"

#include <fmt/format.h>

#include <algorithm>

#include "io/network/dicom_send.h"

namespace isoshift {

void Deliverer::deliver(const std::stop_token& stop, Observer& observer) {
  const auto is_due = [&](const std::string& what) {
    const auto pause = pauses_.find(what);
    return pause == pauses_.end() || pause->second.is_due();
  };
  for (const Delivery& delivery : tree_.pending()) {
    if (stop.stop_requested()) return;
    const auto& [session, peer_name, object] = delivery;
    const std::string key = fmt::format("{}/{}/{}", peer_name, session, object.file);
    if (!is_due(peer_name) || !is_due(key)) continue;
    const auto fail = [&](const std::string& what, const std::exception& error) {
      constexpr std::chrono::seconds kFirst(2), kLongest(300);
      const std::chrono::seconds pause = pauses_.try_emplace(what, kFirst, kLongest).first->second.fail();
      observer.say(fmt::format("session {}: {} not sent, tried again in {} s: {}", delivery.session,
                               delivery.object.file, pause.count(), error.what()));
    };
    try {
      const auto peer = std::ranges::find(watch_.peers, peer_name, &DicomPeer::name);
      if (peer == watch_.peers.end())
        throw PeerError(fmt::format("peer {}: the watch file does not name it", peer_name));
      const std::filesystem::path file = tree_.checked_file(delivery);
      const bool may_be_there = tree_.is_in_doubt(delivery);
      tree_.prepare_to_send(delivery);
      const std::string answer = send_object(file, *peer, may_be_there);
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
}

}  // namespace isoshift
