#include "io/study/session.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <optional>

#include "geometry/rotation.h"
#include "io/dicom/dicom_dataset.h"

namespace isoshift {
namespace {

// Empty components at the end of a name may be written or not (PS3.5 6.2.1.1).
std::string without_trailing_carets(std::string name) {
  name.erase(name.find_last_not_of("^ ") + 1);
  return name;
}

// What a table read-out says of two images; nothing where it is the same, or missing in one of them.
std::optional<Finding> table_finding(const TableReadOut& read_out, const RtImage& image, const RtImage& reference) {
  const auto change = table_change(read_out, image.table, reference.table);
  if (!change) return std::nullopt;
  return Finding{"table-moved", fmt::format("{}: the table {} since {} ({})", image.path.string(), *change,
                                            reference.path.string(), described(read_out.tag))};
}

// Whether both show the same view: one label, and one gantry angle as far as both have it.
bool is_retake(const RtImage& image, const RtImage& earlier) {
  constexpr double kSameAngleRad = rad_from_deg(1.0);
  if (image.label != earlier.label) return false;
  if (!image.gantry_angle_deg || !earlier.gantry_angle_deg) return true;
  return std::abs(wrapped_rad(rad_from_deg(*image.gantry_angle_deg - *earlier.gantry_angle_deg))) < kSameAngleRad;
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
  for (const TableReadOut& read_out : table_read_outs()) {
    const auto value_of = [&](const RtImage& image) { return image.table.*read_out.value; };
    if (std::ranges::any_of(images, [&](const RtImage& image) { return value_of(image).has_value(); }))
      compare(read_out.tag, value_of,
              [&](const RtImage& image, const RtImage& first) { return table_finding(read_out, image, first); });
  }
  return findings;
}

std::vector<Finding> session_doubts(std::span<const RtImage> images, double max_span_s) {
  if (std::ranges::all_of(images, [](const RtImage& image) { return image.table.has_position(); })) return {};
  constexpr const char* kNoReadOuts = "without table read-outs in all views nobody knows whether the table moved";
  std::vector<Finding> doubts;
  const RtImage* earliest = nullptr;
  const RtImage* latest = nullptr;
  for (const RtImage& image : images) {
    const auto at_s = acquisition_seconds(image);
    if (!at_s) continue;
    if (earliest == nullptr || *at_s < *acquisition_seconds(*earliest)) earliest = &image;
    if (latest == nullptr || *at_s > *acquisition_seconds(*latest)) latest = &image;
  }
  if (earliest != nullptr)
    if (const double span_s = *acquisition_seconds(*latest) - *acquisition_seconds(*earliest); span_s > max_span_s)
      doubts.push_back({"time-span", fmt::format("{} was taken {:.0f} s after {}, more than {:.0f} s: {}",
                                                 latest->label, span_s, earliest->label, max_span_s, kNoReadOuts)});
  for (std::size_t n = 1; n < images.size(); ++n)
    if (const auto first = std::ranges::find_if(images.first(n),
                                                [&](const RtImage& earlier) { return is_retake(images[n], earlier); });
        first != images.begin() + static_cast<std::ptrdiff_t>(n))
      doubts.push_back({"table-moved", fmt::format("{} was taken twice ({} and {}): {}", images[n].label,
                                                   first->path.string(), images[n].path.string(), kNoReadOuts)});
  return doubts;
}

std::vector<Finding> table_findings(const RtImage& image, const RtImage& reference) {
  std::vector<Finding> findings;
  for (const TableReadOut& read_out : table_read_outs())
    if (auto finding = table_finding(read_out, image, reference)) findings.push_back(std::move(*finding));
  return findings;
}

}  // namespace isoshift
