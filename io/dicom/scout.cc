#include "io/dicom/scout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "base/error.h"
#include "base/option_name.h"
#include "io/dicom/decode.h"
#include "io/dicom/pixel_padding.h"

namespace isoshift {
namespace {

using Eigen::Vector3d;

constexpr double kLeastSadMm = 300.0, kMostSadMm = 1500.0;  // of CT scanners 500 to 700
constexpr double kMostOffAxis = 1e-3;  // of the sine between an axis of the image and one of the patient

// From the patient's axes, LPS.
Vector3d direction_of(TubeSide side) {
  switch (side) {
    case TubeSide::kLeft: return Vector3d::UnitX();
    case TubeSide::kRight: return -Vector3d::UnitX();
    case TubeSide::kAnterior: return -Vector3d::UnitY();
    case TubeSide::kPosterior: return Vector3d::UnitY();
  }
  return Vector3d::Zero();
}

double distance_from(const DicomItem& dataset, const DcmTagKey& tag, const std::optional<double>& given,
                     const std::string& flag, Notes& notes) {
  const std::optional<double> found = dataset.number(tag);
  if (given) {
    if (found != *given)
      notes.overrides.push_back(fmt::format("{}: {}: {:g} mm for {}, {}", dataset.where(), flag, *given, described(tag),
                                            found ? fmt::format("which is {:g}", *found) : "which is missing"));
    return *given;
  }
  if (!found)
    throw Error(fmt::format("{}: {} is missing\n       {} supplies it", dataset.where(), described(tag), flag));
  return *found;
}

void read_plane(const DicomItem& dataset, Scout& scout) {
  const std::vector<double> orientation = dataset.required_numbers(DCM_ImageOrientationPatient, 6);
  const Vector3d along_row(orientation.data()), along_column(orientation.data() + 3);
  const bool is_lateral = std::abs(along_row.y()) > std::abs(along_row.x());
  const Vector3d across = is_lateral ? Vector3d::UnitY() : Vector3d::UnitX();
  if (!(along_column.cross(Vector3d::UnitZ()).norm() <= kMostOffAxis &&
        along_row.cross(across).norm() <= kMostOffAxis && std::abs(along_row.norm() - 1.0) <= kMostOffAxis &&
        std::abs(along_column.norm() - 1.0) <= kMostOffAxis))
    throw Error(
        fmt::format("{}: {} is {:g}\\{:g}\\{:g}\\{:g}\\{:g}\\{:g}, expected rows across the table along x or y, "
                    "and columns along z",
                    dataset.where(), described(DCM_ImageOrientationPatient), orientation[0], orientation[1],
                    orientation[2], orientation[3], orientation[4], orientation[5]));
  const std::vector<double> spacing = dataset.required_numbers(DCM_PixelSpacing, 2);
  if (!(spacing[0] > 0.0 && spacing[1] > 0.0))
    throw Error(fmt::format("{}: {} is {:g}\\{:g}, expected positive", dataset.where(), described(DCM_PixelSpacing),
                            spacing[0], spacing[1]));
  scout.first_pixel_patient_mm = Vector3d(dataset.required_numbers(DCM_ImagePositionPatient, 3).data());
  scout.column_step_patient_mm = spacing[1] * along_row;
  scout.row_step_patient_mm = spacing[0] * along_column;
}

// They grow with the attenuation along the ray.
Image<float> read_values(const DicomFile& file, const DicomItem& dataset) {
  const PixelFormat format = pixel_format(dataset);
  if (format.frames != 1)
    throw Error(fmt::format("{}: {} is {}, expected 1", dataset.where(), described(DCM_NumberOfFrames), format.frames));
  const std::string photometric = dataset.required_text(DCM_PhotometricInterpretation);
  if (photometric != "MONOCHROME2")
    throw Error(fmt::format("{}: {} is {}, expected MONOCHROME2", dataset.where(),
                            described(DCM_PhotometricInterpretation), photometric));
  const double slope = dataset.number(DCM_RescaleSlope).value_or(1.0);
  if (!(slope > 0.0))
    throw Error(fmt::format("{}: {} is {:g}, expected positive", dataset.where(), described(DCM_RescaleSlope), slope));
  Image<float> values(format.columns, format.rows);
  // What the scanner has not measured shows nothing, as air does.
  const PixelPadding padding(dataset);
  const std::vector<std::int32_t> stored = decode_frame(file, format, 0);
  std::int32_t air = std::numeric_limits<std::int32_t>::max();
  for (const std::int32_t value : stored)
    if (!padding.holds(value)) air = std::min(air, value);
  std::ranges::transform(stored, values.pixels.begin(), [&](std::int32_t value) {
    return static_cast<float>(slope * (padding.holds(value) ? air : value));
  });
  const auto [least, most] = std::ranges::minmax(values.pixels);
  if (least == most) throw Error(fmt::format("{}: is blank: all its pixels hold {:g}", dataset.where(), least / slope));
  return values;
}

}  // namespace

std::string_view to_string(TubeSide side) {
  switch (side) {
    case TubeSide::kLeft: return "left";
    case TubeSide::kRight: return "right";
    case TubeSide::kAnterior: return "anterior";
    case TubeSide::kPosterior: return "posterior";
  }
  return "";
}

std::optional<TubeSide> tube_side_from(std::string_view name) {
  for (const TubeSide side : kTubeSides)
    if (to_string(side) == name) return side;
  return std::nullopt;
}

std::array<TubeSide, 2> Scout::possible_sides() const {
  const Vector3d normal = column_step_patient_mm.cross(row_step_patient_mm);
  if (std::abs(normal.x()) > std::abs(normal.y())) return {TubeSide::kLeft, TubeSide::kRight};
  return {TubeSide::kAnterior, TubeSide::kPosterior};
}

XrayImage Scout::xray(TubeSide side, const Eigen::Isometry3d& room_from_patient) const {
  const Vector3d middle = first_pixel_patient_mm + 0.5 * (values.columns - 1) * column_step_patient_mm;
  XrayImage image;
  image.label = "scout";
  image.meaning = XrayImage::Meaning::kLineIntegral;
  image.values = values;
  image.view = make_line_scan_view({.source_room_mm = room_from_patient * (middle + sad_mm * direction_of(side)),
                                    .first_pixel_room_mm = room_from_patient * first_pixel_patient_mm,
                                    .column_step_room_mm = room_from_patient.linear() * column_step_patient_mm,
                                    .row_step_room_mm = room_from_patient.linear() * row_step_patient_mm,
                                    .sid_by_sad = sid_mm / sad_mm,
                                    .columns = values.columns,
                                    .rows = values.rows},
                                   Beam::kKilovoltage);
  return image;
}

Scout read_scout(const std::filesystem::path& path, const ScoutSwitches& switches, Notes& notes) {
  const DicomFile file = DicomFile::read(path, DicomFile::Extent::kWhole);
  const DicomItem dataset = file.dataset();
  const std::vector<std::string> type = dataset.texts(DCM_ImageType);
  if (dataset.text(DCM_Modality) != "CT" || type.size() < 3 || type[2] != "LOCALIZER")
    throw Error(
        fmt::format("{}: is no localizer of a CT: {} is {} and the third value of {} is {}, expected CT and "
                    "LOCALIZER",
                    path.string(), described(DCM_Modality), dataset.text(DCM_Modality).value_or("missing"),
                    described(DCM_ImageType), type.size() < 3 ? "missing" : type[2]));
  if (const auto tilt = dataset.number(DCM_GantryDetectorTilt); tilt.value_or(0.0) != 0.0)
    throw Error(fmt::format("{}: {} is {:g} degrees, expected 0: scouts of tilted gantries are not read", path.string(),
                            described(DCM_GantryDetectorTilt), *tilt));
  Scout scout;
  scout.identity = read_identity(dataset);
  scout.sop_instance_uid = dataset.required_uid(DCM_SOPInstanceUID);
  scout.frame_of_reference_uid = dataset.required_uid(DCM_FrameOfReferenceUID);
  scout.patient_position = dataset.text(DCM_PatientPosition).value_or("");
  scout.sha256 = file.sha256();
  scout.sad_mm = distance_from(dataset, DCM_DistanceSourceToPatient, switches.sad_mm, option("sad", "MM"), notes);
  scout.sid_mm = distance_from(dataset, DCM_DistanceSourceToDetector, switches.sid_mm, option("sid", "MM"), notes);
  if (!(scout.sad_mm >= kLeastSadMm && scout.sad_mm <= kMostSadMm && scout.sid_mm > scout.sad_mm))
    throw Error(fmt::format("{}: {} is {:g} and {} is {:g} mm, expected {:g} to {:g} mm and a larger one",
                            path.string(), described(DCM_DistanceSourceToPatient), scout.sad_mm,
                            described(DCM_DistanceSourceToDetector), scout.sid_mm, kLeastSadMm, kMostSadMm));
  read_plane(dataset, scout);
  scout.values = read_values(file, dataset);
  return scout;
}

}  // namespace isoshift
