#include "io/network/dicom_send.h"

#include <dcmtk/config/osconfig.h>
// After osconfig.h.
#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/scu.h>
#include <fmt/format.h>

#include <fstream>
#include <iterator>
#include <optional>

#include "base/sha256.h"
#include "io/dicom/dicom_dataset.h"
#include "io/network/peer_tls.h"

namespace isoshift {
namespace {

constexpr Uint32 kTimeoutS = 30;
constexpr Uint16 kWarning = 0xB000, kWarningMask = 0xF000;

class Scu : public DcmSCU {
 public:
  using DcmSCU::useSecureConnection;
};

// An association for one abstract syntax.
class Association {
 public:
  // Throws Error where the peer does not accept it.
  Association(const DicomPeer& peer, const char* abstract_syntax) : peer_(peer) {
    if (peer.tls) tls_.emplace(peer);
    scu_.setAETitle(peer.calling_aet.c_str());
    scu_.setPeerAETitle(peer.called_aet.c_str());
    scu_.setPeerHostName(peer.host.c_str());
    scu_.setPeerPort(peer.port);
    scu_.setConnectionTimeout(static_cast<Sint32>(kTimeoutS));
    scu_.setACSETimeout(kTimeoutS);
    scu_.setDIMSETimeout(kTimeoutS);
    scu_.setDIMSEBlockingMode(DIMSE_NONBLOCKING);
    OFList<OFString> syntaxes;
    syntaxes.push_back(UID_LittleEndianExplicitTransferSyntax);
    syntaxes.push_back(UID_LittleEndianImplicitTransferSyntax);
    check(scu_.addPresentationContext(abstract_syntax, syntaxes), "presentation context");
    check(scu_.initNetwork(), "no connection can be prepared");
    if (tls_) check(scu_.useSecureConnection(&tls_->layer()), "no TLS connection can be prepared");
    const OFCondition negotiated = scu_.negotiateAssociation();
    context_ = negotiated.good() ? scu_.findAnyPresentationContextID(abstract_syntax, "") : 0;
    if (tls_ && !tls_->refusal().empty()) throw PeerError(tls_->refusal());
    if (negotiated == NET_EC_NoAcceptablePresentationContexts || (negotiated.good() && context_ == 0))
      fail(fmt::format("does not take {}", dcmFindNameOfUID(abstract_syntax, abstract_syntax)));
    check(negotiated, "no association");
  }
  ~Association() {
    if (scu_.isConnected()) scu_.releaseAssociation();
  }
  Association(const Association&) = delete;
  Association& operator=(const Association&) = delete;

  DcmSCU& scu() { return scu_; }
  T_ASC_PresentationContextID context() const { return context_; }

  [[noreturn]] void fail(const std::string& why) const { throw Error(fmt::format("peer {}: {}", peer_.name, why)); }
  void check(const OFCondition& condition, const char* what) const {
    if (condition.bad()) throw PeerError(fmt::format("peer {}: {}: {}", peer_.name, what, condition.text()));
  }

 private:
  const DicomPeer& peer_;
  std::optional<PeerTls> tls_;
  Scu scu_;
  T_ASC_PresentationContextID context_ = 0;
};

// Whether the peer lists the object. One that does not answer queries, or refuses this one, lists nothing.
bool is_listed(const DicomItem& object, const DicomPeer& peer) {
  const std::string uid = object.required_uid(DCM_SOPInstanceUID);
  DcmDataset query;
  query.putAndInsertString(DCM_QueryRetrieveLevel, "IMAGE");
  query.putAndInsertString(DCM_StudyInstanceUID, object.required_uid(DCM_StudyInstanceUID).c_str());
  query.putAndInsertString(DCM_SeriesInstanceUID, object.required_uid(DCM_SeriesInstanceUID).c_str());
  query.putAndInsertString(DCM_SOPInstanceUID, uid.c_str());
  OFList<QRResponse*> responses;
  try {
    Association association(peer, UID_FINDStudyRootQueryRetrieveInformationModel);
    association.check(association.scu().sendFINDRequest(association.context(), &query, &responses), "query");
  } catch (const Error&) {
    // What has come by then counts.
  }
  bool is_there = false;
  for (const QRResponse* response : responses) {
    OFString found;
    if (response->m_dataset != nullptr) response->m_dataset->findAndGetOFString(DCM_SOPInstanceUID, found);
    is_there |= found == uid.c_str();
    delete response;  // NOLINT(cppcoreguidelines-owning-memory): DCMTK hands them over so
  }
  return is_there;
}

// The file is read once, into memory: what is sent is what was hashed, however long a peer takes.
DcmFileFormat read_released(const std::filesystem::path& file, const std::string& sha256) {
  std::ifstream stream(file, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(stream), {}};
  if (const std::string found = sha256_of(bytes); found != sha256)
    throw Error(fmt::format("{}: was changed: its SHA-256 is {}, expected {}", file.string(), found, sha256));
  DcmInputBufferStream buffer;
  buffer.setBuffer(bytes.data(), static_cast<offile_off_t>(bytes.size()));
  buffer.setEos();
  DcmFileFormat object;
  object.transferInit();
  if (const OFCondition loaded = object.read(buffer); loaded.bad())
    throw Error(fmt::format("{}: cannot be read: {}", file.string(), loaded.text()));
  object.transferEnd();
  return object;
}

}  // namespace

std::string send_object(const std::filesystem::path& file, const std::string& sha256, const DicomPeer& peer,
                        bool may_be_there) {
  DcmFileFormat object = read_released(file, sha256);
  const DicomItem dataset(*object.getDataset(), file.string());
  if (may_be_there && is_listed(dataset, peer)) return "was there, from an earlier attempt";
  Association association(peer, dataset.required_uid(DCM_SOPClassUID).c_str());
  Uint16 status = 0xFFFF;
  association.check(association.scu().sendSTORERequest(association.context(), "", object.getDataset(), status),
                    "the object was not sent whole");
  if (status == STATUS_Success) return "";
  if ((status & kWarningMask) == kWarning) return fmt::format("stored with warning 0x{:04X}", status);
  association.fail(fmt::format("refused the object with status 0x{:04X}", status));
}

}  // namespace isoshift
