#include "io/study/session.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>

#include "base/option_name.h"
#include "geometry/rotation.h"
#include "io/dicom/dicom_dataset.h"

namespace isoshift {
namespace {

// What a table read-out says of two images; nothing where it is the same, or missing in one of them.
std::optional<FailedCheck> table_finding(const TableReadOut& read_out, const RtImage& image, const RtImage& reference) {
  const auto change = table_change(read_out, image.table, reference.table);
  if (!change) return std::nullopt;
  return FailedCheck{"table-moved", fmt::format("{}: the table {} since {} ({})", image.path.string(), *change,
                                                reference.path.string(), described(read_out.tag))};
}

constexpr const char* kNoReadOuts =
    "without measured table positions in all views it is not known whether the table moved";

// Whether both show the same view: by one projection matrix, from one gantry angle, or, where one of them has none,
// under one label. The files of room-mounted imagers may hold the gantry angle of the linac, which is no imager's, and
// labels of their own for every exposure.
bool is_retake(const RtImage& image, const RtImage& earlier) {
  constexpr double kSameAngleRad = rad_from_deg(1.0);
  if (image.pixel_from_room || earlier.pixel_from_room) return image.pixel_from_room == earlier.pixel_from_room;
  if (!image.gantry_angle_deg || !earlier.gantry_angle_deg) return image.label == earlier.label;
  return std::abs(wrapped_rad(rad_from_deg(*image.gantry_angle_deg - *earlier.gantry_angle_deg))) < kSameAngleRad;
}

// Views of two machines, and table angles that only some views have: taken for all of them, these may be another setup.
std::vector<FailedCheck> setting_doubts(std::span<const RtImage> images) {
  std::vector<FailedCheck> doubts;
  const auto machine_of = [](const RtImage& image) {
    const auto name = image.equipment.find("RadiationMachineName");
    return name == image.equipment.end() ? std::string() : name->second;
  };
  for (const RtImage& image : images)
    if (machine_of(image) != machine_of(images.front()))
      doubts.push_back({"table-moved", fmt::format("{} is of machine \"{}\", {} of \"{}\" ({})", image.label,
                                                   machine_of(image), images.front().label, machine_of(images.front()),
                                                   described(DCM_RadiationMachineName))});
  for (const RtImage& image : images)
    if (image.fraction_number && images.front().fraction_number &&
        image.fraction_number != images.front().fraction_number)
      doubts.push_back({"table-moved", fmt::format("{} is of fraction {}, {} of {} ({})", image.label,
                                                   *image.fraction_number, images.front().label,
                                                   *images.front().fraction_number, described(DCM_FractionNumber))});
  for (const RtImage& image : images)
    if (image.isocenter_mm && images.front().isocenter_mm &&
        (*image.isocenter_mm - *images.front().isocenter_mm).norm() > kSameIsocenterMm)
      doubts.push_back(
          {"table-moved", fmt::format("{} and {} have different isocenters in their frame ({})", image.label,
                                      images.front().label, described(DCM_IsocenterPosition))});
  for (const TableReadOut& read_out : table_read_outs()) {
    const auto has_value = [&](const RtImage& image) { return (image.table.*read_out.value).has_value(); };
    const auto turned = std::ranges::find_if(images, [&](const RtImage& image) {
      return has_value(image) && std::abs(*(image.table.*read_out.value)) > kMaxTableTurnDeg;
    });
    const auto silent = std::ranges::find_if_not(images, has_value);
    if (read_out.is_angle && turned != images.end() && silent != images.end())
      doubts.push_back({"table-moved", fmt::format("{} is {} degrees in {} and missing in {}: whether the table turned "
                                                   "between them is unknown",
                                                   described(read_out.tag), *(turned->table.*read_out.value),
                                                   turned->label, silent->label)});
  }
  return doubts;
}

// The option that supplies a table angle.
std::string_view option_for(const TableReadOut& read_out) {
  if (read_out.tag == DCM_PatientSupportAngle) return "couch-angle";
  return read_out.tag == DCM_TableTopPitchAngle ? "couch-pitch" : "couch-roll";
}

// Views whose distance in time is not known. An unmoved table does not prove that the patient stayed on it.
std::optional<FailedCheck> unknown_time_doubt(std::span<const RtImage> images, bool is_table_known) {
  const char* const unknown = is_table_known ? "so it is not known whether the views show one setup" : kNoReadOuts;
  for (const RtImage& image : images) {
    const bool is_frame_known = image.has_own_time || is_table_known;  // frames of one file are of one exposure series
    if (!is_frame_known || !acquisition_seconds(image))
      return FailedCheck{"time-span", fmt::format("{}: when it was taken is unknown ({}), and {}", image.label,
                                                  acquisition_seconds(image) ? "a frame without a time of its own"
                                                                             : why_time_is_unknown(image),
                                                  unknown)};
    if (image.utc_offset_min.has_value() != images.front().utc_offset_min.has_value())
      return FailedCheck{"time-span",
                         fmt::format("{} and {}: only one of them says how far its time is from UTC ({}), and {}",
                                     images.front().label, image.label, described(DCM_TimezoneOffsetFromUTC), unknown)};
  }
  return std::nullopt;
}

// Views too far apart in time.
std::optional<FailedCheck> time_span_doubt(std::span<const RtImage> images, double max_span_s) {
  const auto [earliest, latest] = std::ranges::minmax_element(images, {}, acquisition_seconds);
  const double span_s = *acquisition_seconds(*latest) - *acquisition_seconds(*earliest);
  if (span_s <= max_span_s) return std::nullopt;
  return FailedCheck{"time-span", fmt::format("{} was taken {:.0f} s after {}, more than {:.0f} s: {}", latest->label,
                                              span_s, earliest->label, max_span_s, kNoReadOuts)};
}

}  // namespace

std::vector<FailedCheck> patient_findings(std::span<const PatientInput> inputs) {
  struct Attribute {
    std::string Identity::* member;
    DcmTagKey tag;
    std::string (*comparable)(std::string);
  };
  const auto as_it_is = [](std::string text) { return text; };
  const std::array<Attribute, 4> attributes = {
      {{&Identity::patient_id, DCM_PatientID, as_it_is},
       {&Identity::patient_id_issuer, DCM_IssuerOfPatientID, as_it_is},
       {&Identity::patient_name, DCM_PatientName, comparable_name},
       {&Identity::patient_birth_date, DCM_PatientBirthDate, comparable_date}}};
  std::vector<FailedCheck> findings;
  for (const Attribute& attribute : attributes) {
    const auto value_of = [&](const PatientInput& input) {
      return attribute.comparable(input.identity->*attribute.member);
    };
    const PatientInput* reference = nullptr;
    for (const PatientInput& input : inputs) {
      const std::string value = value_of(input);
      if (value.empty()) {
        if (attribute.tag == DCM_PatientID)
          findings.push_back({"patient-mismatch", fmt::format("{}: {} is empty: whose it is is unknown", input.name,
                                                              described(attribute.tag))});
        continue;
      }
      if (reference == nullptr) reference = &input;
      if (value != value_of(*reference))
        findings.push_back(
            {"patient-mismatch", fmt::format("{}: {} differs from that of {}: the inputs are of different patients",
                                             input.name, described(attribute.tag), reference->name)});
    }
  }
  return findings;
}

std::vector<FailedCheck> session_findings(std::span<const RtImage> images, Notes& notes) {
  std::vector<FailedCheck> findings;
  const auto compare = [&](const DcmTagKey& tag, auto&& value_of, auto&& finding_of) {
    const RtImage* reference = nullptr;
    for (const RtImage& image : images) {
      if (!value_of(image)) continue;
      if (reference == nullptr) reference = &image;
      if (auto finding = finding_of(image, *reference)) findings.push_back(std::move(*finding));
    }
    for (const RtImage& image : images)
      if (!value_of(image) && images.size() > 1)
        notes.warnings.push_back(
            fmt::format("{}: {}, so it could not be compared with the other views", image.label,
                        tag == DCM_AcquisitionTime ? why_time_is_unknown(image) : described(tag) + " is missing"));
  };

  compare(DCM_AcquisitionTime, acquisition_seconds,
          [](const RtImage& image, const RtImage& first) -> std::optional<FailedCheck> {
            const double apart_s = std::abs(*acquisition_seconds(image) - *acquisition_seconds(first));
            if (apart_s <= kMaxTimeSpanS) return std::nullopt;
            return FailedCheck{
                "time-span",
                fmt::format(
                    "{}: taken {:.0f} s from {}, expected at most {:.0f} ({})\n"
                    "       Of several sessions isoshift batch registers each, and {}, {}, {} or {} chooses one.",
                    image.path.string(), apart_s, first.path.string(), kMaxTimeSpanS, described(DCM_AcquisitionTime),
                    option("latest"), option("date"), option("fraction"), option("session"))};
          });
  for (const TableReadOut& read_out : table_read_outs()) {
    const auto value_of = [&](const RtImage& image) { return image.table.*read_out.value; };
    if (std::ranges::any_of(images, [&](const RtImage& image) { return value_of(image).has_value(); }))
      compare(read_out.tag, value_of,
              [&](const RtImage& image, const RtImage& first) { return table_finding(read_out, image, first); });
  }
  return findings;
}

std::vector<FailedCheck> replaced_doubts(const RtImage& image, const RtImage& by_profile, const RtImage& used) {
  std::vector<FailedCheck> doubts;
  const auto doubt = [&](const char* key, const std::string& by, const DcmTagKey& tag, const auto& value) {
    doubts.push_back({key, fmt::format("{} contradicts {}: {} is {}", by, image.label, described(tag), value)});
  };
  for (const TableReadOut& read_out : table_read_outs()) {
    if (!table_change(read_out, used.table, image.table)) continue;
    const double angle_deg = *(used.table.*read_out.value);
    const bool is_of_profile = by_profile.table.*read_out.value == angle_deg;
    doubt("table-moved",
          is_of_profile ? fmt::format("the machine profile, which says {},", angle_deg)
                        : option(option_for(read_out), fmt::to_string(angle_deg)),
          read_out.tag, *(image.table.*read_out.value));
  }
  // A profile is there to correct these; a switch knows nothing of the machine.
  constexpr double kSameMm = 0.5;
  const auto differ = [](const auto& one, const auto& other) {
    return one && other && std::abs(*one - *other) > kSameMm;
  };
  if (by_profile.gantry_angle_deg && used.gantry_angle_deg &&
      std::abs(wrapped_rad(rad_from_deg(*used.gantry_angle_deg - *by_profile.gantry_angle_deg))) >
          rad_from_deg(kMaxTableTurnDeg))
    doubt("planned-geometry", option("gantry-angle", fmt::format("{}={}", image.label, *used.gantry_angle_deg)),
          DCM_GantryAngle, *by_profile.gantry_angle_deg);
  if (differ(used.sad_mm, by_profile.sad_mm))
    doubt("planned-geometry", option("sad", fmt::to_string(*used.sad_mm)), DCM_RadiationMachineSAD, *by_profile.sad_mm);
  if (differ(used.sid_mm, by_profile.sid_mm))
    doubt("planned-geometry", option("sid", fmt::to_string(*used.sid_mm)), DCM_RTImageSID, *by_profile.sid_mm);
  if (used.position_mm && by_profile.position_mm && (*used.position_mm - *by_profile.position_mm).norm() > kSameMm)
    doubt("planned-geometry",
          option("rt-image-position", fmt::format("{},{}", used.position_mm->x(), used.position_mm->y())),
          DCM_RTImagePosition, fmt::format("{}\\{}", by_profile.position_mm->x(), by_profile.position_mm->y()));
  if (used.patient_position && by_profile.patient_position && used.patient_position != by_profile.patient_position)
    doubt("planned-geometry", option("patient-position", *used.patient_position), DCM_PatientPosition,
          *by_profile.patient_position);
  return doubts;
}

std::vector<FailedCheck> session_doubts(std::span<const RtImage> images, double max_span_s) {
  if (images.size() < 2) return {};
  std::vector<FailedCheck> doubts = setting_doubts(images);
  // Read-outs that were planned, or that one view lacks, do not tell that the table stood still.
  const bool is_table_known = all_tell_position(images);
  auto time_doubt = unknown_time_doubt(images, is_table_known);
  if (!time_doubt && !is_table_known) time_doubt = time_span_doubt(images, max_span_s);
  if (time_doubt) doubts.push_back(std::move(*time_doubt));
  if (is_table_known) return doubts;
  for (std::size_t n = 1; n < images.size(); ++n)
    if (const auto first = std::ranges::find_if(images.first(n),
                                                [&](const RtImage& earlier) { return is_retake(images[n], earlier); });
        first != images.begin() + static_cast<std::ptrdiff_t>(n))
      doubts.push_back(
          {"table-moved",
           fmt::format("{} and {} show the same view, and {}",
                       first->label == images[n].label ? first->path.string() : first->label,
                       first->label == images[n].label ? images[n].path.string() : images[n].label, kNoReadOuts)});
  return doubts;
}

std::vector<FailedCheck> table_findings(const RtImage& image, const RtImage& reference) {
  std::vector<FailedCheck> findings;
  for (const TableReadOut& read_out : table_read_outs())
    if (auto finding = table_finding(read_out, image, reference)) findings.push_back(std::move(*finding));
  return findings;
}

}  // namespace isoshift
