#include "io/session.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>

#include "geometry/rotation.h"
#include "io/dicom_dataset.h"

namespace isoshift {
namespace {

constexpr double kMaxTableMoveMm = 0.5;

// Empty components at the end of a name may be written or not (PS3.5 6.2.1.1).
std::string without_trailing_carets(std::string name) {
  name.erase(name.find_last_not_of("^ ") + 1);
  return name;
}

struct TableReadOut {
  std::optional<double> RtImage::*value;
  DcmTagKey tag;
  bool is_angle;
};
const std::array kTableReadOuts = {
    TableReadOut{&RtImage::table_lateral_mm, DCM_TableTopLateralPosition, false},
    TableReadOut{&RtImage::table_longitudinal_mm, DCM_TableTopLongitudinalPosition, false},
    TableReadOut{&RtImage::table_vertical_mm, DCM_TableTopVerticalPosition, false},
    TableReadOut{&RtImage::support_angle_deg, DCM_PatientSupportAngle, true},
    TableReadOut{&RtImage::eccentric_angle_deg, DCM_TableTopEccentricAngle, true},
    TableReadOut{&RtImage::table_pitch_deg, DCM_TableTopPitchAngle, true},
    TableReadOut{&RtImage::table_roll_deg, DCM_TableTopRollAngle, true},
};

// Precondition: both say where the table stood.
std::optional<Finding> table_finding(const TableReadOut& read_out, const RtImage& image, const RtImage& reference) {
  const double change = *(image.*read_out.value) - *(reference.*read_out.value);
  const std::string where = image.path.string(), since = reference.path.string();
  if (!read_out.is_angle) {
    if (std::abs(change) <= kMaxTableMoveMm) return std::nullopt;
    return Finding{"table-moved", fmt::format("{}: the table moved by {:.1f} mm since {} ({})", where, change, since,
                                              described(read_out.tag))};
  }
  const double turned_deg = deg_from_rad(wrapped_rad(rad_from_deg(change)));
  if (std::abs(turned_deg) <= kMaxTableTurnDeg) return std::nullopt;
  return Finding{"table-moved", fmt::format("{}: the table turned by {:.1f} degrees since {} ({})", where, turned_deg,
                                            since, described(read_out.tag))};
}

}  // namespace

std::vector<Finding> patient_findings(const Identity& reference, const Identity& other, const std::string& where,
                                      const std::string& reference_name) {
  std::vector<Finding> findings;
  const auto differ = [&](const std::string Identity::*member, const DcmTagKey& tag, bool may_be_empty) {
    const bool is_empty = (other.*member).empty() || (reference.*member).empty();
    if (without_trailing_carets(other.*member) == without_trailing_carets(reference.*member) &&
        (may_be_empty || !is_empty))
      return;
    if (may_be_empty && is_empty) return;
    findings.push_back({"patient-mismatch",
                        is_empty ? fmt::format("{}: {} is empty in this file or in {}: whose they are is unknown",
                                               where, described(tag), reference_name)
                                 : fmt::format("{}: {} differs from that of {}: the inputs are of different patients",
                                               where, described(tag), reference_name)});
  };
  differ(&Identity::patient_id, DCM_PatientID, false);
  differ(&Identity::patient_id_issuer, DCM_IssuerOfPatientID, true);
  differ(&Identity::patient_name, DCM_PatientName, true);
  differ(&Identity::patient_birth_date, DCM_PatientBirthDate, true);
  return findings;
}

std::vector<Finding> session_findings(std::span<const RtImage> images, Notes& notes) {
  std::vector<Finding> findings;
  const auto compare = [&](const DcmTagKey& tag, auto&& value_of, auto&& finding_of) {
    const RtImage* reference = nullptr;
    for (const RtImage& image : images) {
      if (!value_of(image)) continue;
      if (reference == nullptr) reference = &image;
      if (auto finding = finding_of(image, *reference)) findings.push_back(std::move(*finding));
    }
    for (const RtImage& image : images)
      if (!value_of(image) && images.size() > 1)
        notes.warnings.push_back(fmt::format("{}: {} is missing, so it could not be compared with the other views",
                                             image.label, described(tag)));
  };

  compare(DCM_AcquisitionTime, acquisition_seconds,
          [](const RtImage& image, const RtImage& first) -> std::optional<Finding> {
            const double apart_s = std::abs(*acquisition_seconds(image) - *acquisition_seconds(first));
            if (apart_s <= kMaxTimeSpanS) return std::nullopt;
            return Finding{"time-span", fmt::format("{}: taken {:.0f} minutes from {}, expected at most 10 ({})",
                                                    image.path.string(), apart_s / 60.0, first.path.string(),
                                                    described(DCM_AcquisitionTime))};
          });
  for (const TableReadOut& read_out : kTableReadOuts) {
    const auto value_of = [&](const RtImage& image) { return image.*read_out.value; };
    if (std::ranges::any_of(images, [&](const RtImage& image) { return value_of(image).has_value(); }))
      compare(read_out.tag, value_of,
              [&](const RtImage& image, const RtImage& first) { return table_finding(read_out, image, first); });
  }
  return findings;
}

std::vector<Finding> table_findings(const RtImage& image, const RtImage& reference) {
  std::vector<Finding> findings;
  for (const TableReadOut& read_out : kTableReadOuts)
    if (image.*read_out.value && reference.*read_out.value)
      if (auto finding = table_finding(read_out, image, reference)) findings.push_back(std::move(*finding));
  return findings;
}

}  // namespace isoshift
