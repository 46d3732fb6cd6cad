#include "io/objects/deidentification.h"

#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <span>
#include <string>
#include <string_view>

#include "base/error.h"
#include "base/pattern.h"
#include "base/version.h"
#include "io/dicom/decode.h"
#include "io/objects/object_header.h"
#include "io/objects/spatial_registration.h"

namespace isoshift {
namespace {

// What is known of an attribute; the VR decides about all others (action_for).
enum class Action {
  kKeep,
  kRemove,
  kEmpty,
  kReplaceName,
  kReplaceId,
  kReplaceBirthDate,
  kReplaceText,
  kReplaceUids,
  kMoveDates,
  kLookInside
};

struct Replaced {
  DcmTagKey tag;
  const char* kind;  // of the pseudonym: short, a label has at most 16 characters
};
const Replaced kReplacedTexts[] = {
    {DCM_StationName, "Station"},
    {DCM_DeviceSerialNumber, "Device"},
    {DCM_DetectorID, "Detector"},
    {DCM_ProtocolName, "Protocol"},
    {DCM_RadiationMachineName, "Machine"},
    {DCM_TreatmentMachineName, "Machine"},
    {DCM_RTImageLabel, "Image"},
    {DCM_RTPlanLabel, "Plan"},
    {DCM_StructureSetLabel, "Structures"},
    {DCM_StackID, "Stack"},
    {DCM_ROIName, "Structure"},
    {DCM_BeamName, "Beam"},
    {DCM_ContentLabel, "CONTENT"},
};

// Attributes that an object must have, if only empty (type 2).
const DcmTagKey kEmptied[] = {DCM_PatientSex,        DCM_AccessionNumber, DCM_ReferringPhysicianName,
                              DCM_StudyID,           DCM_OperatorsName,   DCM_PositionReferenceIndicator,
                              DCM_ROIInterpreter,    DCM_ReviewerName,    DCM_ContentCreatorName,
                              DCM_ContentDescription};

const DcmTagKey kKeptTexts[] = {DCM_SpecificCharacterSet,
                                DCM_Manufacturer,
                                DCM_ManufacturerModelName,
                                DCM_SoftwareVersions,
                                DCM_ConvolutionKernel,
                                DCM_FilterType,
                                DCM_CodeValue,
                                DCM_CodingSchemeDesignator,
                                DCM_CodingSchemeVersion,
                                DCM_CodeMeaning,
                                DCM_TimezoneOffsetFromUTC,
                                DCM_RescaleType};

// Of the groups that are kept: what Table E.1-1 removes and no VR tells.
const DcmTagKey kRemoved[] = {DCM_InstitutionCodeSequence,
                              DCM_InstitutionalDepartmentTypeCodeSequence,
                              DCM_ReferringPhysicianIdentificationSequence,
                              DCM_ConsultingPhysicianIdentificationSequence,
                              DCM_PhysiciansOfRecordIdentificationSequence,
                              DCM_PerformingPhysicianIdentificationSequence,
                              DCM_PhysiciansReadingStudyIdentificationSequence,
                              DCM_OperatorIdentificationSequence,
                              DCM_AdmittingDiagnosesCodeSequence,
                              DCM_ReferencedStudySequence,
                              DCM_ReferencedPerformedProcedureStepSequence,
                              DCM_ReferencedPatientSequence,
                              {0x0008, 0x1301},  // PrincipalDiagnosisCodeSequence
                              {0x0008, 0x1302},  // PrimaryDiagnosisCodeSequence
                              {0x0008, 0x1303},  // SecondaryDiagnosesCodeSequence
                              {0x0008, 0x1304},  // HistologicalDiagnosesCodeSequence
                              DCM_UDISequence,
                              DCM_TransducerIdentificationSequence,
                              DCM_RETIRED_ModifyingDeviceID,
                              DCM_GraphicAnnotationSequence,
                              DCM_ContentCreatorIdentificationCodeSequence,
                              {0x3006, 0x004D},   // ROICreatorSequence
                              {0x3006, 0x004E}};  // ROIInterpreterSequence

// UIDs that say what an object is, or what a code means, and not which it is.
const DcmTagKey kKeptUids[] = {DCM_SOPClassUID,
                               DCM_ReferencedSOPClassUID,
                               DCM_CodingSchemeUID,
                               DCM_ContextUID,
                               DCM_MappingResourceUID,
                               DCM_RelatedGeneralSOPClassUID,
                               DCM_OriginalSpecializedSOPClassUID};

// Frames of reference that every machine has (PS3.6 A-2): IEC 61217 fixed, the robotic arm's, the table top's.
bool is_well_known_frame(std::string_view uid) {
  return uid == "1.2.840.10008.1.4.3.1" || uid == "1.2.840.10008.1.4.3.2" || uid == "1.2.840.10008.1.4.3.3";
}

// The standard's own UIDs of classes and codes, and well-known frames.
bool is_kept(const DcmTagKey& tag, std::string_view uid) {
  const bool is_standard = uid.starts_with("1.2.840.10008.") && uid.find_first_not_of("0123456789.") == uid.npos;
  return is_well_known_frame(uid) || (is_standard && std::ranges::count(kKeptUids, tag) > 0);
}

// Beside them all groups are removed, that of the file meta information too, which is made anew.
constexpr std::array<Uint16, 13> kKeptGroups = {0x0008, 0x0018, 0x0020, 0x0028, 0x0070, 0x3002, 0x3004,
                                                0x3006, 0x3008, 0x300A, 0x300C, 0x300E, 0x5200};
const DcmTagKey kKeptOfOtherGroups[] = {DCM_PurposeOfReferenceCodeSequence, DCM_ConceptNameCodeSequence};

bool is_among(std::span<const DcmTagKey> tags, const DcmTagKey& tag) { return std::ranges::count(tags, tag) > 0; }

const char* kind_of(const DcmTagKey& tag) {
  const auto* const found = std::ranges::find(kReplacedTexts, tag, &Replaced::tag);
  return found == std::end(kReplacedTexts) ? nullptr : found->kind;
}

// Whether an attribute has the VR of the dictionary: under another one it may hold anything.
bool has_its_vr(const DcmTagKey& tag, DcmEVR found) {
  const DcmEVR vr = DcmTag(tag).getEVR();
  const bool is_number = found == EVR_US || found == EVR_SS;
  return found == vr || (vr == EVR_xs && is_number) || (vr == EVR_lt && (is_number || found == EVR_OW));
}

Action action_for(const DcmTagKey& tag, DcmEVR vr) {
  if (kind_of(tag) != nullptr) return Action::kReplaceText;
  if (tag == DCM_PatientName) return Action::kReplaceName;
  if (tag == DCM_PatientID) return Action::kReplaceId;
  if (tag == DCM_PatientBirthDate) return Action::kReplaceBirthDate;
  if (is_among(kEmptied, tag)) return Action::kEmpty;
  const bool is_kept_group = std::ranges::count(kKeptGroups, tag.getGroup()) > 0;
  const bool is_known = DcmTag(tag).error().good();
  if (!is_known || (!is_kept_group && !is_among(kKeptOfOtherGroups, tag)) || is_among(kRemoved, tag))
    return Action::kRemove;
  if (!has_its_vr(tag, vr)) return Action::kRemove;
  switch (vr) {
    case EVR_SQ: return Action::kLookInside;
    case EVR_UI: return Action::kReplaceUids;
    case EVR_DA:
    case EVR_DT: return Action::kMoveDates;
    case EVR_CS:
    case EVR_TM:
    case EVR_DS:
    case EVR_IS:
    case EVR_AT:
    case EVR_FD:
    case EVR_FL:
    case EVR_OD:
    case EVR_OF:
    case EVR_SL:
    case EVR_SS:
    case EVR_UL:
    case EVR_US:
    case EVR_xs: return Action::kKeep;
    case EVR_lt:
    case EVR_OW: return tag.getGroup() == 0x0028 ? Action::kKeep : Action::kRemove;  // look-up tables
    default: return is_among(kKeptTexts, tag) ? Action::kKeep : Action::kRemove;
  }
}

// Files may hold anything under the VR of a number, a time or a code word.
bool is_of_its_vr(const DicomItem& item, const DcmTagKey& tag, DcmEVR vr) {
  std::string_view allowed;
  if (vr == EVR_DS || vr == EVR_IS) allowed = "0123456789+-.eE ";
  if (vr == EVR_CS) allowed = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_ ";
  static const Pattern time("(([01][0-9]|2[0-3])(:?[0-5][0-9](:?([0-5][0-9]|60)(\\.[0-9]{1,6})?)?)?)?");
  if (vr == EVR_TM)
    return std::ranges::all_of(item.texts(tag), [&](const std::string& value) { return time.matches(value); });
  return allowed.empty() || std::ranges::all_of(item.texts(tag), [&](const std::string& value) {
           return value.find_first_not_of(allowed) == std::string::npos;
         });
}

// The values of an attribute, each replaced; without those for which nothing remains.
void replace(DicomItem& item, const DcmTagKey& tag, const auto& by) {
  std::string joined;
  for (const std::string& value : item.texts(tag))
    if (const std::string replaced = value.empty() ? "" : by(value); !replaced.empty())
      joined += (joined.empty() ? "" : "\\") + replaced;
  item.put(tag, joined);
}

// What isoshift says of a registration that is not accepted must not be lost.
bool is_ours(const DicomItem& item, const DcmTagKey& tag) {
  if (tag != DCM_ContentLabel && tag != DCM_ContentDescription) return false;
  const std::string says = item.text(tag).value_or("");
  return says == kLabelOfAccepted || says == kLabelOfReview || says == kLabelOfHand || says == kReviewDescription ||
         says == kHandDescription;
}

void replace_in(DicomItem& item, Pseudonyms& pseudonyms) {
  const std::string issuer = item.text(DCM_IssuerOfPatientID).value_or("");
  for (const auto& element : item.elements()) {
    const DcmTagKey tag = element.first;
    const DcmEVR vr = element.second;
    if (is_ours(item, tag)) continue;
    switch (action_for(tag, vr)) {
      case Action::kKeep:
        if (!is_of_its_vr(item, tag, vr)) item.erase(tag);
        break;
      case Action::kRemove: item.erase(tag); break;
      case Action::kEmpty: item.put(tag, ""); break;
      case Action::kReplaceText:
        replace(item, tag, [&](const std::string& value) { return pseudonyms.text(kind_of(tag), value); });
        break;
      case Action::kReplaceName:
        replace(item, tag, [&](const std::string& value) { return pseudonyms.patient_name(value); });
        break;
      case Action::kReplaceBirthDate:
        replace(item, tag, [&](const std::string& value) { return pseudonyms.birth_date(value); });
        break;
      case Action::kReplaceId:
        replace(item, tag, [&](const std::string& value) { return pseudonyms.patient_id(value, issuer); });
        break;
      case Action::kReplaceUids:
        replace(item, tag,
                [&](const std::string& value) { return is_kept(tag, value) ? value : pseudonyms.uid(value); });
        break;
      case Action::kMoveDates:
        replace(item, tag, [&](const std::string& value) { return pseudonyms.date(value); });
        break;
      case Action::kLookInside:
        for (DicomItem& inner : item.items(tag)) replace_in(inner, pseudonyms);
        break;
    }
  }
}

void copy(const DcmTagKey& tag, const DicomItem& from, const DicomItem& to) {
  DcmElement* copied = nullptr;
  if (from.dcmtk().findAndGetElement(tag, copied, OFFalse, OFTrue).bad() || to.dcmtk().insert(copied).bad())
    throw Error(fmt::format("{}: {} cannot be copied", from.where(), described(tag)));
}

// The pixels as their format has them, and nothing else: not what unused bits hold, nor comments of compressed streams.
void put_pixels_alone(const DicomFile& file, DicomItem to) {
  const PixelFormat format = pixel_format(file.dataset());
  std::vector<std::uint16_t> words;
  std::string bytes;
  for (int frame = 0; frame < format.frames; ++frame)
    for (const std::int32_t value : decode_frame(file, format, frame)) {
      if (format.bits_allocated == 16)
        words.push_back(static_cast<std::uint16_t>(value));
      else
        bytes.push_back(static_cast<char>(value));
    }
  if (format.bits_allocated == 16)
    to.put_pixels(words);
  else
    to.put_bytes(DCM_PixelData, bytes);
}

}  // namespace

DicomFile deidentified(const DicomFile& file, Pseudonyms& pseudonyms) {
  DicomFile safe;
  const DicomItem from = file.dataset();
  for (const auto& element : from.elements())
    if (element.first != DCM_PixelData) copy(element.first, from, safe.dataset());
  DicomItem dataset = safe.dataset();
  replace_in(dataset, pseudonyms);
  if (from.has_value(DCM_PixelData)) put_pixels_alone(file, dataset);
  // PS3.15 E.1.1, and CID 7050 of PS3.16.
  dataset.put(DCM_PatientIdentityRemoved, "YES");
  dataset.put(DCM_DeidentificationMethod, fmt::format("isoshift {}: PS3.15 Annex E, and stricter", kVersion));
  put_code(dataset.append_item(DCM_DeidentificationMethodCodeSequence), "113100",
           "Basic Application Confidentiality Profile");
  put_code(dataset.append_item(DCM_DeidentificationMethodCodeSequence), "113107",
           "Retain Longitudinal Temporal Information Modified Dates Option");
  dataset.put(DCM_LongitudinalTemporalInformationModified, "MODIFIED");
  return safe;
}

BurntIn burnt_in(const DicomItem& dataset) {
  const std::string says = dataset.text(DCM_BurnedInAnnotation).value_or("");
  if (says == "NO") return BurntIn::kNo;
  return says == "YES" ? BurntIn::kYes : BurntIn::kUnknown;
}

}  // namespace isoshift
