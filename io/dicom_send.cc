#include "io/dicom_send.h"

#include <dcmtk/config/osconfig.h>
// After osconfig.h.
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmnet/scu.h>
#include <dcmtk/dcmtls/tlsscu.h>
#include <fmt/format.h>

#include <memory>

#include "geometry/error.h"
#include "io/dicom_dataset.h"

namespace isoshift {
namespace {

constexpr Uint32 kTimeoutS = 30;
constexpr Uint16 kWarning = 0xB000, kWarningMask = 0xF000;

std::unique_ptr<DcmSCU> scu_for(const DicomPeer& peer) {
  if (!peer.tls) return std::make_unique<DcmSCU>();
  auto scu = std::make_unique<DcmTLSSCU>();
  scu->enableAuthentication(peer.tls->key.c_str(), peer.tls->certificate.c_str());
  scu->addTrustedCertFile(peer.tls->ca.c_str());
  scu->setPeerCertVerification(DCV_requireCertificate);
  scu->setTLSProfile(TSP_Profile_BCP195_ND);
  return scu;
}

}  // namespace

std::string send_object(const std::filesystem::path& file, const DicomPeer& peer) {
  const auto check = [&](const OFCondition& condition, const char* what) {
    if (condition.bad()) throw Error(fmt::format("peer {}: {}: {}", peer.name, what, condition.text()));
  };
  const DicomFile object = DicomFile::read(file, DicomFile::Extent::kHeader);
  const std::string sop_class = object.dataset().required_text(DCM_SOPClassUID);
  const std::unique_ptr<DcmSCU> scu = scu_for(peer);
  scu->setAETitle(peer.calling_aet.c_str());
  scu->setPeerAETitle(peer.called_aet.c_str());
  scu->setPeerHostName(peer.host.c_str());
  scu->setPeerPort(peer.port);
  scu->setConnectionTimeout(static_cast<Sint32>(kTimeoutS));
  scu->setACSETimeout(kTimeoutS);
  scu->setDIMSETimeout(kTimeoutS);
  scu->setDIMSEBlockingMode(DIMSE_NONBLOCKING);
  OFList<OFString> syntaxes;
  syntaxes.push_back(UID_LittleEndianExplicitTransferSyntax);
  syntaxes.push_back(UID_LittleEndianImplicitTransferSyntax);
  check(scu->addPresentationContext(sop_class.c_str(), syntaxes), "presentation context");
  check(scu->initNetwork(), "no connection can be prepared");
  check(scu->negotiateAssociation(), "no association");
  const T_ASC_PresentationContextID context = scu->findAnyPresentationContextID(sop_class.c_str(), "");
  if (context == 0) {
    scu->releaseAssociation();
    throw Error(fmt::format("peer {}: does not take objects of class {}", peer.name, sop_class));
  }
  Uint16 status = 0xFFFF;
  check(scu->sendSTORERequest(context, file.c_str(), nullptr, status), "the object was not sent whole");
  scu->releaseAssociation();
  if (status == STATUS_Success) return "";
  if ((status & kWarningMask) == kWarning) return fmt::format("stored with warning 0x{:04X}", status);
  throw Error(fmt::format("peer {}: refused the object with status 0x{:04X}", peer.name, status));
}

}  // namespace isoshift
