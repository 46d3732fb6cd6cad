#pragma once
// Sends DICOM objects to a peer: C-STORE (PS3.4 Annex B), with TLS as peer_tls.h has it.

#include <filesystem>

#include "base/error.h"
#include "io/config/watch_file.h"

namespace isoshift {

// No association with the peer, or one that was cut off: nothing else can be sent to it now.
class PeerError : public Error {
 public:
  using Error::Error;
};

// Returns when the peer has answered that it stored the object: with success, or with a warning (PS3.7 C.4.2), which is
// the text; empty otherwise. One that `may_be_there`, since an answer to an earlier attempt was not heard, is asked for
// first (C-FIND, Study Root, PS3.4 C.6.2), and not sent if it is there; a peer that answers no queries gets it again.
// Throws PeerError, or Error where the peer refuses this object or the file has not that SHA-256, naming which and why.
std::string send_object(const std::filesystem::path& file, const std::string& sha256, const DicomPeer& peer,
                        bool may_be_there);

}  // namespace isoshift
