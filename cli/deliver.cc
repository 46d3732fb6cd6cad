#include "cli/deliver.h"

#include <fmt/format.h>

#include <algorithm>

#include "geometry/error.h"
#include "io/dicom_send.h"

namespace isoshift {

bool Deliverer::deliver(Console& console) {
  constexpr std::chrono::seconds kFirstPause(2), kLongestPause(300);
  const auto now = std::chrono::steady_clock::now();
  bool has_sent = false;
  for (const Delivery& delivery : tree_.pending()) {
    const auto peer = std::ranges::find(watch_.peers, delivery.peer, &DicomPeer::name);
    Pause& pause = pauses_[delivery.peer];
    if (now < pause.until) continue;
    try {
      if (peer == watch_.peers.end())
        throw Error(fmt::format("peer {}: the watch file does not name it", delivery.peer));
      tree_.mark_sent(delivery, send_object(tree_.checked_file(delivery), *peer));
      console.err << fmt::format("session {}: {} sent to {}\n", delivery.session, delivery.object.file, delivery.peer);
      pause = {};
      has_sent = true;
    } catch (const Error& error) {
      pause.length = std::clamp(2 * pause.length, kFirstPause, kLongestPause);
      pause.until = now + pause.length;
      console.err << fmt::format("session {}: {} not sent, tried again in {} s: {}\n", delivery.session,
                                 delivery.object.file, pause.length.count(), error.what());
    }
  }
  return has_sent;
}

}  // namespace isoshift
