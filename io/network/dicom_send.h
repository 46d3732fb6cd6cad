#pragma once
// Sends DICOM objects to a peer: C-STORE (PS3.4 Annex B), with TLS as peer_tls.h has it.

#include <filesystem>

#include "base/error.h"
#include "io/config/watch_file.h"

namespace isoshift {

// There is no association with the peer, or it was cut off: nothing else can be sent to this peer now.
class PeerError : public Error {
 public:
  using Error::Error;
};

// Sends an object, and returns when the peer has answered that it stored the object. The text is the peer's warning
// (PS3.7 C.4.2), or empty. `may_be_there`: the answer to an earlier attempt was not received. Then the peer is first
// asked whether it has the object (C-FIND, Study Root, PS3.4 C.6.2), and the object is not sent if it has; a peer that
// answers no queries receives the object again. Throws PeerError. Throws Error with the reason if the peer refuses this
// object, or if the SHA-256 of the file is another one.
std::string send_object(const std::filesystem::path& file, const std::string& sha256, const DicomPeer& peer,
                        bool may_be_there);

}  // namespace isoshift
