#pragma once
// Sends a released object to a peer.

#include <filesystem>
#include <string>

#include "io/network/dicom_send.h"

namespace isoshift {

class Sender {
 public:
  virtual ~Sender() = default;

  // As send_object().
  virtual std::string send(const std::filesystem::path& file, const std::string& sha256, const DicomPeer& peer,
                           bool may_be_there) = 0;
};

class DicomSender : public Sender {
 public:
  std::string send(const std::filesystem::path& file, const std::string& sha256, const DicomPeer& peer,
                   bool may_be_there) override {
    return send_object(file, sha256, peer, may_be_there);
  }
};

}  // namespace isoshift
