#include "cli/deliver.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "geometry/error.h"
#include "io/dicom_send.h"

namespace isoshift {

void Deliverer::deliver(Console& console) {
  constexpr std::chrono::seconds kFirstPause(2), kLongestPause(300);
  const auto now = std::chrono::steady_clock::now();
  std::set<std::string> failing;  // in this round: the next of its objects has its turn in the next one
  for (const Delivery& delivery : tree_.pending()) {
    const auto peer = std::ranges::find(watch_.peers, delivery.peer, &DicomPeer::name);
    const std::string key = fmt::format("{}/{}/{}", delivery.session, delivery.peer, delivery.object.file);
    Pause& pause = pauses_[key];
    if (now < pause.until || failing.contains(delivery.peer)) continue;
    try {
      if (peer == watch_.peers.end())
        throw Error(fmt::format("peer {}: the watch file does not name it", delivery.peer));
      const std::filesystem::path file = tree_.checked_file(delivery);
      const bool may_be_there = tree_.is_in_doubt(delivery);
      tree_.prepare_to_send(delivery);
      const std::string answer = send_object(file, *peer, may_be_there);
      tree_.mark_sent(delivery, answer);
      console.err << fmt::format("session {}: {} sent to {}{}\n", delivery.session, delivery.object.file, delivery.peer,
                                 answer.empty() ? "" : ": " + answer);
      pauses_.erase(key);
    } catch (const std::exception& error) {
      failing.insert(delivery.peer);
      pause.length = std::clamp(2 * pause.length, kFirstPause, kLongestPause);
      pause.until = now + pause.length;
      console.err << fmt::format("session {}: {} not sent, tried again in {} s: {}\n", delivery.session,
                                 delivery.object.file, pause.length.count(), error.what());
    }
  }
}

}  // namespace isoshift
