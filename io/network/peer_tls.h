#pragma once
// TLS with a DICOM peer: PS3.15 B.10 (non-downgrading BCP 195), both sides with certificates. The handshake fails,
// before anything of DICOM is sent, unless the peer's certificate is signed by an authority of `ca` and belongs to the
// peer: it names the host, or it is the certificate that the watch file pins.

#include <dcmtk/config/osconfig.h>
// After osconfig.h.
#include <dcmtk/dcmtls/tlslayer.h>

#include <string>

#include "io/config/watch_file.h"

struct x509_store_ctx_st;

namespace isoshift {

class PeerTls {
 public:
  // Throws PeerError naming the file that cannot be used. The peer must outlive this; it must have `tls`.
  explicit PeerTls(const DicomPeer& peer);
  PeerTls(const PeerTls&) = delete;
  PeerTls& operator=(const PeerTls&) = delete;

  DcmTransportLayer& layer() { return layer_; }
  // Why the peer's certificate was refused; empty: none was.
  const std::string& refusal() const { return refusal_; }

 private:
  void expect_host();
  static int check(x509_store_ctx_st* presented, void* self);

  const DicomPeer& peer_;
  DcmTLSTransportLayer layer_;
  std::string refusal_;
};

}  // namespace isoshift
