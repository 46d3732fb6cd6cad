#include "io/dicom/identity.h"

namespace isoshift {
namespace {

struct Attribute {
  DcmTagKey tag;
  std::string Identity::* member;
};

const Attribute kAttributes[] = {
    {DCM_PatientID, &Identity::patient_id},
    {DCM_PatientName, &Identity::patient_name},
    {DCM_PatientBirthDate, &Identity::patient_birth_date},
    {DCM_PatientSex, &Identity::patient_sex},
    {DCM_StudyInstanceUID, &Identity::study_instance_uid},
    {DCM_StudyDate, &Identity::study_date},
    {DCM_StudyTime, &Identity::study_time},
    {DCM_StudyID, &Identity::study_id},
    {DCM_AccessionNumber, &Identity::accession_number},
    {DCM_ReferringPhysicianName, &Identity::referring_physician},
};

}  // namespace

Identity read_identity(const DicomItem& dataset) {
  Identity identity;
  identity.character_set = dataset.text(DCM_SpecificCharacterSet).value_or("");
  identity.patient_id_issuer = dataset.text(DCM_IssuerOfPatientID).value_or("");
  for (const auto& [tag, member] : kAttributes) identity.*member = dataset.raw_text(tag).value_or("");
  return identity;
}

void put_identity(DicomItem& dataset, const Identity& identity) {
  if (!identity.character_set.empty()) dataset.put(DCM_SpecificCharacterSet, identity.character_set);
  if (!identity.patient_id_issuer.empty()) dataset.put(DCM_IssuerOfPatientID, identity.patient_id_issuer);
  for (const auto& [tag, member] : kAttributes) dataset.put(tag, identity.*member);
}

}  // namespace isoshift
