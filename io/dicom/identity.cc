#include "io/dicom/identity.h"

#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <string_view>

#include "base/error.h"
#include "base/utf8.h"

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

std::ptrdiff_t characters(std::string_view text) { return std::ranges::count_if(text, begins_character); }

// Whether the value is one of its VR (PS3.5 6.2). The groups of a name (alphabetic=ideographic=phonetic) count each.
bool is_allowed(const DcmTagKey& tag, std::string_view text) {
  const DcmVR vr = DcmTag(tag).getVR();
  const OFString value(text.data(), text.size());
  if (vr.getEVR() == EVR_DA) return DcmDate::checkStringValue(value, "1").good();
  if (vr.getEVR() == EVR_TM) return DcmTime::checkStringValue(value, "1").good();
  if (vr.getEVR() == EVR_CS) return DcmCodeString::checkStringValue(value, "1").good();
  while (vr.getEVR() == EVR_PN && text.find('=') != std::string_view::npos) {
    const std::size_t end = text.find('=');
    if (!is_allowed(tag, text.substr(0, end))) return false;
    text.remove_prefix(end + 1);
  }
  return characters(text) <= static_cast<std::ptrdiff_t>(vr.getMaxValueLength());
}

}  // namespace

Identity read_identity(const DicomItem& dataset) {
  Identity identity;
  identity.character_set = dataset.text(DCM_SpecificCharacterSet).value_or("");
  identity.patient_id_issuer = dataset.text(DCM_IssuerOfPatientID).value_or("");
  for (const auto& [tag, member] : kAttributes) identity.*member = dataset.raw_text(tag).value_or("");
  identity.study_instance_uid = dataset.uid(DCM_StudyInstanceUID).value_or("");
  return identity;
}

void make_writable(Identity& identity, const std::string& where, Notes& notes) {
  if (identity.study_instance_uid.empty())
    throw Error(fmt::format("{}: {} is missing", where, described(DCM_StudyInstanceUID)));
  const auto check_whose_it_is = [&](const DcmTagKey& tag, const std::string& text) {
    if (!is_allowed(tag, text))
      throw Error(
          fmt::format("{}: {} is longer than the {} characters that DICOM allows: no object of this patient can "
                      "be written",
                      where, described(tag), DcmTag(tag).getVR().getMaxValueLength()));
  };
  check_whose_it_is(DCM_PatientID, identity.patient_id);
  check_whose_it_is(DCM_IssuerOfPatientID, identity.patient_id_issuer);
  check_whose_it_is(DCM_PatientName, identity.patient_name);
  for (const auto& [tag, member] : kAttributes) {
    if ((identity.*member).empty() || is_allowed(tag, identity.*member)) continue;
    notes.warnings.push_back(
        fmt::format("{}: {} is not as DICOM allows, and left out of what is written", where, described(tag)));
    (identity.*member).clear();
  }
}

std::string comparable_name(std::string name) {
  name.erase(name.find_last_not_of("^ ") + 1);
  std::ranges::transform(name, name.begin(), [](unsigned char c) { return std::tolower(c); });
  return name;
}

std::string comparable_date(std::string date) {
  std::erase(date, '.');
  return date;
}

void put_identity(DicomItem& dataset, const Identity& identity) {
  if (!identity.character_set.empty()) dataset.put(DCM_SpecificCharacterSet, identity.character_set);
  if (!identity.patient_id_issuer.empty()) dataset.put(DCM_IssuerOfPatientID, identity.patient_id_issuer);
  for (const auto& [tag, member] : kAttributes) dataset.put(tag, identity.*member);
}

}  // namespace isoshift
