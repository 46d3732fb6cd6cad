#include "io/dicom/ct_series.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <utility>

#include "base/error.h"
#include "base/large_vector.h"
#include "base/parallel.h"
#include "base/sha256.h"
#include "io/dicom/ct_doubts.h"
#include "io/dicom/decode.h"
#include "io/dicom/pixel_padding.h"

namespace isoshift {
namespace {

constexpr double kMinPositionDifferenceMm = 0.01;  // CT-6: closer slices are duplicates
constexpr double kMaxAxisResidualMm = 0.1;         // CT-8: of every slice's position from the straight line
constexpr int kMaxGapsListed = 10;
constexpr double kMaxVoxels = 2e9;  // CT-14: 8 GB as float; more is a mistake or an attack
constexpr float kAirHu = -1000.0F;

struct Slice {
  std::string where;
  std::size_t frame = 0;                     // of its file
  Eigen::Vector3d position_mm;               // ImagePositionPatient: center of the first voxel
  Eigen::Vector3d row_direction;             // ImageOrientationPatient, first three
  Eigen::Vector3d column_direction;          // ImageOrientationPatient, last three
  double row_spacing_mm, column_spacing_mm;  // PixelSpacing: between rows, between columns
  PixelFormat format;
  std::string sop_instance_uid;
  std::string frame_of_reference_uid;
  Identity identity;
  std::string patient_position;  // as the file says it; may be empty
  bool is_lossy = false;         // compressed with loss
  std::string sha256;            // of its file
  std::vector<float> hu;
};

void check_size(const std::string& where, const PixelFormat& format, int slices) {
  if (static_cast<double>(format.pixels_per_frame()) * slices > kMaxVoxels)
    throw Error(fmt::format("{}: {} x {} x {} voxels are more than this program takes", where, format.columns,
                            format.rows, slices));
}

// Stored values outside the padding range become HU; padding and anything below air becomes air.
std::vector<float> hu_from_stored(const DicomItem& dataset, const DicomItem& rescale,
                                  const std::vector<std::int32_t>& stored_values) {
  const double slope = rescale.required_number(DCM_RescaleSlope);
  const double intercept = rescale.required_number(DCM_RescaleIntercept);
  if (slope == 0.0) throw Error(fmt::format("{}: {} is 0", rescale.where(), described(DCM_RescaleSlope)));
  if (const auto type = rescale.text(DCM_RescaleType); type && *type != "HU" && *type != "hu")
    throw Error(fmt::format("{}: {} is {}, expected HU", rescale.where(), described(DCM_RescaleType), *type));

  const PixelPadding padding(dataset);
  std::vector<float> hu(stored_values.size());
  std::ranges::transform(stored_values, hu.begin(), [&](std::int32_t value) {
    if (padding.holds(value)) return kAirHu;
    return std::max(kAirHu, static_cast<float>(slope * value + intercept));
  });
  return hu;
}

// Where a frame lies: attributes of a CT Image itself, of an Enhanced CT's frames those of three macros.
struct FrameGeometry {
  DicomItem position, orientation, spacing, rescale;
};

// The functional groups of an Enhanced CT (PS3.3 C.7.6.16): a macro is a frame's own, else the one that all share.
class FunctionalGroups {
 public:
  explicit FunctionalGroups(const DicomItem& dataset)
      : where_(dataset.where()),
        frames_(dataset.items(DCM_PerFrameFunctionalGroupsSequence)),
        shared_(dataset.items(DCM_SharedFunctionalGroupsSequence)) {}

  std::size_t frames() const { return frames_.size(); }

  std::optional<DicomItem> find(std::size_t frame, const DcmTagKey& macro) const {
    if (const auto own = frames_[frame].items(macro); !own.empty()) return own.front();
    for (const DicomItem& group : shared_)
      if (const auto items = group.items(macro); !items.empty()) return items.front();
    return std::nullopt;
  }
  DicomItem required(std::size_t frame, const DcmTagKey& macro) const {
    auto item = find(frame, macro);
    if (!item) throw Error(fmt::format("{} frame {}: {} is missing", where_, frame + 1, described(macro)));
    return *item;
  }

 private:
  std::string where_;
  std::vector<DicomItem> frames_, shared_;
};

Slice slice_at(const FrameGeometry& geometry, const DicomItem& dataset, const std::string& where) {
  Slice slice;
  slice.where = where;
  slice.sop_instance_uid = dataset.required_uid(DCM_SOPInstanceUID);
  slice.frame_of_reference_uid = dataset.required_uid(DCM_FrameOfReferenceUID);
  slice.identity = read_identity(dataset);
  slice.patient_position = dataset.text(DCM_PatientPosition).value_or("");
  slice.is_lossy = dataset.text(DCM_LossyImageCompression) == "01";
  slice.position_mm = Eigen::Vector3d(geometry.position.required_numbers(DCM_ImagePositionPatient, 3).data());
  const std::vector<double> orientation = geometry.orientation.required_numbers(DCM_ImageOrientationPatient, 6);
  slice.row_direction = Eigen::Vector3d(orientation.data());
  slice.column_direction = Eigen::Vector3d(orientation.data() + 3);
  const std::vector<double> spacing = geometry.spacing.required_numbers(DCM_PixelSpacing, 2);
  slice.row_spacing_mm = spacing[0];
  slice.column_spacing_mm = spacing[1];
  if (spacing[0] <= 0.0 || spacing[1] <= 0.0)
    throw Error(
        fmt::format("{}: {} is {}\\{}, expected positive", where, described(DCM_PixelSpacing), spacing[0], spacing[1]));
  return slice;
}

// A localizer among the frames is no slice (PS3.3 C.8.15.2.1.1.3).
void check_frame_types(const DicomItem& dataset, const FunctionalGroups& groups) {
  for (std::size_t frame = 0; frame < groups.frames(); ++frame)
    if (const auto item = groups.find(frame, DCM_CTImageFrameTypeSequence))
      if (const auto type = item->texts(DCM_FrameType); std::ranges::find(type, "LOCALIZER") != type.end())
        throw Error(
            fmt::format("{} frame {}: {} says LOCALIZER, expected a slice.\n"
                        "       Export the volume without its localizer",
                        dataset.where(), frame + 1, described(DCM_FrameType)));
}

// One volume of one time: which of several is meant must not be guessed.
void check_one_volume(const DicomItem& dataset, const FunctionalGroups& groups, const PixelFormat& format) {
  if (groups.frames() != static_cast<std::size_t>(format.frames))
    throw Error(fmt::format("{}: {} has {} items, expected one for each of {} frames", dataset.where(),
                            described(DCM_PerFrameFunctionalGroupsSequence), groups.frames(), format.frames));
  if (dataset.has_value(DCM_ConcatenationUID) && dataset.number(DCM_InConcatenationTotalNumber) != 1)
    throw Error(fmt::format("{}: is part of a concatenation ({}), which is not read in parts", dataset.where(),
                            described(DCM_ConcatenationUID)));
  std::set<std::string> volumes;
  for (std::size_t frame = 0; frame < groups.frames(); ++frame)
    if (const auto content = groups.find(frame, DCM_FrameContentSequence))
      volumes.insert(fmt::format("stack {} at time {}", content->text(DCM_StackID).value_or("1"),
                                 content->number(DCM_TemporalPositionIndex).value_or(1)));
  if (volumes.size() > 1)
    throw Error(fmt::format("{}: holds {} volumes ({}), expected one.\n       Export the one that was planned on",
                            dataset.where(), volumes.size(), fmt::join(volumes, ", ")));
}

// The slices of one file: one of a CT Image, all frames of an Enhanced CT (A.38).
std::vector<Slice> read_slices_of(const std::filesystem::path& path) {
  const DicomFile file = DicomFile::read(path, DicomFile::Extent::kWhole);
  const DicomItem dataset = file.dataset();
  expect_modality(dataset, "CT");
  const PixelFormat format = pixel_format(dataset);
  check_size(dataset.where(), format, format.frames);
  const FunctionalGroups groups(dataset);
  const bool is_enhanced = groups.frames() > 0;
  if (is_enhanced) {
    check_one_volume(dataset, groups, format);
    check_frame_types(dataset, groups);
  } else if (format.frames != 1)
    throw Error(fmt::format("{}: {} is {}, expected 1 for a CT Image", dataset.where(), described(DCM_NumberOfFrames),
                            format.frames));
  std::vector<Slice> slices;
  for (std::size_t frame = 0; frame < static_cast<std::size_t>(format.frames); ++frame) {
    FrameGeometry geometry{dataset, dataset, dataset, dataset};
    std::string where = dataset.where();
    if (is_enhanced) {
      geometry = {.position = groups.required(frame, DCM_PlanePositionSequence),
                  .orientation = groups.required(frame, DCM_PlaneOrientationSequence),
                  .spacing = groups.required(frame, DCM_PixelMeasuresSequence),
                  .rescale = groups.required(frame, DCM_PixelValueTransformationSequence)};
      where += fmt::format(" frame {}", frame + 1);
    }
    slices.push_back(slice_at(geometry, dataset, where));
    slices.back().frame = frame;
    slices.back().format = format;
    slices.back().sha256 = file.sha256();
    slices.back().hu = hu_from_stored(dataset, geometry.rescale, decode_frame(file, format, static_cast<int>(frame)));
  }
  return slices;
}

std::vector<Slice> read_slices(std::span<const std::filesystem::path> files, const Progress& progress) {
  std::vector<std::vector<Slice>> of_files(files.size());
  std::mutex mutex;
  std::size_t done = 0;
  parallel_for_waiting(files.size(), [&](std::size_t n) {
    of_files[n] = read_slices_of(files[n]);
    const std::lock_guard lock(mutex);
    if (progress) progress(++done, files.size());
  });
  std::vector<Slice> slices;
  for (std::vector<Slice>& of_file : of_files) std::ranges::move(of_file, std::back_inserter(slices));
  return slices;
}

// CT-4: unit length and right angles within 1e-3; then exact by Gram-Schmidt. Returns (row, column, normal).
Eigen::Matrix3d orthonormal_axes(const Slice& slice) {
  const Eigen::Vector3d& r = slice.row_direction;
  const Eigen::Vector3d& c = slice.column_direction;
  if (std::abs(r.norm() - 1.0) > 1e-3 || std::abs(c.norm() - 1.0) > 1e-3 || std::abs(r.dot(c)) > 1e-3)
    throw Error(fmt::format("{}: {} is not a pair of perpendicular unit vectors", slice.where,
                            described(DCM_ImageOrientationPatient)));
  Eigen::Matrix3d axes;
  axes.col(0) = r.normalized();
  axes.col(1) = (c - c.dot(axes.col(0)) * axes.col(0)).normalized();
  axes.col(2) = axes.col(0).cross(axes.col(1));
  return axes;
}

void check_same_lattice(const std::vector<Slice>& slices) {
  const Slice& first = slices.front();
  const auto differs = [&](const Slice& slice, const DcmTagKey& tag) {
    throw Error(fmt::format("{}: {} differs from that of {}\n       One CT series must be one regular volume",
                            slice.where, described(tag), first.where));
  };
  for (const Slice& slice : slices) {
    if (slice.frame_of_reference_uid != first.frame_of_reference_uid) differs(slice, DCM_FrameOfReferenceUID);
    if (slice.identity.study_instance_uid != first.identity.study_instance_uid) differs(slice, DCM_StudyInstanceUID);
    if (!slice.patient_position.empty() && !first.patient_position.empty() &&
        slice.patient_position != first.patient_position)
      differs(slice, DCM_PatientPosition);
    if (slice.format.columns != first.format.columns) differs(slice, DCM_Columns);
    if (slice.format.rows != first.format.rows) differs(slice, DCM_Rows);
    if (slice.row_spacing_mm != first.row_spacing_mm || slice.column_spacing_mm != first.column_spacing_mm)
      differs(slice, DCM_PixelSpacing);
    if ((slice.row_direction - first.row_direction).cwiseAbs().maxCoeff() > 1e-4 ||
        (slice.column_direction - first.column_direction).cwiseAbs().maxCoeff() > 1e-4)
      differs(slice, DCM_ImageOrientationPatient);
  }
}

// One patient throughout, whatever the Series Instance UID says.
std::vector<FailedCheck> patient_findings(const std::vector<Slice>& slices) {
  const Slice& first = slices.front();
  for (const Slice& slice : slices)
    for (const auto& [tag, member] :
         {std::pair(DCM_PatientID, &Identity::patient_id), std::pair(DCM_PatientName, &Identity::patient_name),
          std::pair(DCM_PatientBirthDate, &Identity::patient_birth_date)})
      if (slice.identity.*member != first.identity.*member)
        return {{"patient-mismatch", fmt::format("{}: {} differs from that of {}: slices of different patients",
                                                 slice.where, described(tag), first.where)}};
  return {};
}

// An instance lies in one place. What copied it to another one may have got other things wrong.
void check_instances(const std::vector<Slice>& slices) {
  std::map<std::pair<std::string, std::size_t>, const Slice*> by_instance;
  for (const Slice& slice : slices) {
    const Slice& first = *by_instance.try_emplace({slice.sop_instance_uid, slice.frame}, &slice).first->second;
    if ((slice.position_mm - first.position_mm).norm() > kMinPositionDifferenceMm)
      throw Error(fmt::format("{}: has the {} of {}, but lies elsewhere ({})\n       Export the series again",
                              slice.where, described(DCM_SOPInstanceUID), first.where,
                              described(DCM_ImagePositionPatient)));
  }
}

// CT-6. The same instance twice counts once; two different slices in one place are an error.
void drop_duplicates(std::vector<Slice>& sorted, const Eigen::Vector3d& normal, Notes& notes) {
  std::vector<Slice> kept;
  for (Slice& slice : sorted) {
    if (!kept.empty() && (slice.position_mm - kept.back().position_mm).dot(normal) < kMinPositionDifferenceMm) {
      const bool same = slice.sop_instance_uid == kept.back().sop_instance_uid && slice.hu == kept.back().hu;
      if (!same)
        throw Error(
            fmt::format("{}: lies where {} lies ({})\n       One series must hold one slice per position; select one "
                        "acquisition or phase",
                        slice.where, kept.back().where, described(DCM_ImagePositionPatient)));
      notes.warnings.push_back(fmt::format("{}: the same slice as {}, counted once", slice.where, kept.back().where));
      continue;
    }
    kept.push_back(std::move(slice));
  }
  sorted = std::move(kept);
}

// CT-7: where the distances are not uniform, says so in the terms of the person who exported the series.
std::vector<FailedCheck> spacing_findings(const std::vector<double>& positions_mm, double median_mm,
                                          const std::string& series) {
  std::vector<FailedCheck> findings;
  int gaps = 0;
  const double tolerance_mm = std::max(0.01, 0.001 * median_mm);
  for (std::size_t k = 0; k + 1 < positions_mm.size(); ++k) {
    const double distance_mm = positions_mm[k + 1] - positions_mm[k];
    if (std::abs(distance_mm - median_mm) <= tolerance_mm) continue;
    const double multiple = std::round(distance_mm / median_mm);
    const bool missing = multiple >= 2.0 && std::abs(distance_mm - multiple * median_mm) <= multiple * tolerance_mm;
    if (++gaps > kMaxGapsListed) break;
    findings.push_back(
        {"gaps", fmt::format("CT series {}: slices {} and {} are {:.3g} mm apart, the others {:.3g} mm ({}).\n"
                             "       A uniform series is needed; {}",
                             series, k + 1, k + 2, distance_mm, median_mm, described(DCM_ImagePositionPatient),
                             missing ? "a slice is probably missing." : "this one has uneven spacing.")});
  }
  return findings;
}

// Slices at uneven positions, interpolated linearly onto even ones.
Volume<float> resampled(const std::vector<Slice>& slices, const std::vector<double>& positions_mm,
                        const Eigen::Affine3d& patient_from_voxel, int count, double spacing_mm) {
  const PixelFormat& format = slices.front().format;
  Volume<float> volume;
  volume.size = {format.columns, format.rows, count};
  volume.patient_from_voxel = patient_from_voxel;
  volume.voxels = large_vector<float>(volume.size.cast<std::size_t>().prod());
  parallel_for(0, count, [&](int k) {
    const double position_mm = positions_mm.front() + k * spacing_mm;
    const auto above = std::ranges::upper_bound(positions_mm, position_mm) - positions_mm.begin();
    const auto below = static_cast<std::size_t>(std::clamp<std::ptrdiff_t>(above - 1, 0, std::ssize(positions_mm) - 2));
    const double gap_mm = positions_mm[below + 1] - positions_mm[below];
    const auto fraction = static_cast<float>(std::clamp((position_mm - positions_mm[below]) / gap_mm, 0.0, 1.0));
    std::ranges::transform(slices[below].hu, slices[below + 1].hu, volume.voxels.begin() + volume.index(0, 0, k),
                           [fraction](float a, float b) { return a + fraction * (b - a); });
  });
  return volume;
}

Volume<float> assembled(std::vector<Slice>& slices, const Eigen::Matrix3d& axes, const std::string& series,
                        const Allowances& allowed, Notes& notes) {
  const Eigen::Vector3d normal = axes.col(2);
  const Slice& first = slices.front();
  std::vector<double> positions_mm, distances_mm;
  for (const Slice& slice : slices) positions_mm.push_back(slice.position_mm.dot(normal));
  for (std::size_t k = 0; k + 1 < slices.size(); ++k) distances_mm.push_back(positions_mm[k + 1] - positions_mm[k]);
  std::vector<double> ordered = distances_mm;
  std::ranges::sort(ordered);
  const double median_mm = ordered[ordered.size() / 2];
  const double length_mm = positions_mm.back() - positions_mm.front();
  if (length_mm < 20.0 || length_mm > 2500.0)
    throw Error(fmt::format("CT series {}: its slices span {:.1f} mm, expected 20 to 2500 mm", series, length_mm));

  // CT-8: the third axis runs from the first to the last slice, along the normal or, for a tilted gantry, beside it.
  const Eigen::Vector3d stack_mm = slices.back().position_mm - first.position_mm;
  for (std::size_t k = 0; k < slices.size(); ++k) {
    const Eigen::Vector3d on_line = first.position_mm + (positions_mm[k] - positions_mm[0]) / length_mm * stack_mm;
    if ((slices[k].position_mm - on_line).norm() > kMaxAxisResidualMm)
      throw Error(fmt::format("{}: {} lies {:.2f} mm beside the line through the series' first and last slice",
                              slices[k].where, described(DCM_ImagePositionPatient),
                              (slices[k].position_mm - on_line).norm()));
  }
  const std::vector<FailedCheck> findings = spacing_findings(positions_mm, median_mm, series);
  settle(findings, allowed, notes);
  const double spacing_mm = findings.empty() ? length_mm / static_cast<double>(slices.size() - 1)
                                             : std::max(ordered.front(), 0.25 * median_mm);
  const int count = findings.empty() ? static_cast<int>(slices.size())
                                     : static_cast<int>(std::floor(length_mm / spacing_mm + 1e-6)) + 1;

  check_size("CT series " + series, first.format, count);

  Eigen::Affine3d patient_from_voxel;
  patient_from_voxel.makeAffine();
  patient_from_voxel.linear().col(0) = axes.col(0) * first.column_spacing_mm;
  patient_from_voxel.linear().col(1) = axes.col(1) * first.row_spacing_mm;
  patient_from_voxel.linear().col(2) = stack_mm * (spacing_mm / length_mm);
  patient_from_voxel.translation() = first.position_mm;
  return resampled(slices, positions_mm, patient_from_voxel, count, spacing_mm);
}

// CT-1: what the slices are. Localizers are left aside before, where they say so (StudyFiles).
void warn_of_image_type(const DicomItem& header, Notes& notes) {
  const std::vector<std::string> types = header.texts(DCM_ImageType);
  if (types.size() < 3)
    notes.warnings.push_back(
        fmt::format("{}: {} has {} values, expected at least 3, of which the third tells a slice "
                    "from a localizer.\n       The file is taken as a slice",
                    header.where(), described(DCM_ImageType), types.size()));
  for (const std::string& type : types)
    if (type == "MIP" || type == "MAX_IP" || type == "MINIP" || type == "MIN_IP")
      notes.warnings.push_back(
          fmt::format("the CT holds the largest or least of several values ({} says {}), not those of one moment",
                      described(DCM_ImageType), type));
}

}  // namespace

CtSeries read_ct_series(std::span<const std::filesystem::path> files, const Allowances& allowed, Notes& notes,
                        const Progress& progress) {
  if (files.empty()) throw Error("a CT series needs at least 2 slices, found none");
  const DicomFile file = DicomFile::read(files.front(), DicomFile::Extent::kHeader);
  const DicomItem header = file.dataset();
  CtSeries series;
  series.identity = read_identity(header);
  make_writable(series.identity, header.where(), notes);
  series.sop_class_uid = header.required_uid(DCM_SOPClassUID);
  series.series_instance_uid = header.required_uid(DCM_SeriesInstanceUID);
  series.frame_of_reference_uid = header.required_uid(DCM_FrameOfReferenceUID);
  series.body_part_examined = header.text(DCM_BodyPartExamined).value_or("");
  series.patient_position = header.text(DCM_PatientPosition).value_or("");
  series.acquired_on = header.text(DCM_AcquisitionDate).value_or(header.text(DCM_SeriesDate).value_or(""));
  warn_of_image_type(header, notes);
  std::vector<Slice> slices = read_slices(files, progress);
  if (std::ranges::any_of(slices, &Slice::is_lossy))
    notes.warnings.push_back("the CT has been compressed with loss (LossyImageCompression is 01)");
  settle(patient_findings(slices), allowed, notes);
  check_same_lattice(slices);
  check_instances(slices);
  const Eigen::Matrix3d axes = orthonormal_axes(slices.front());
  std::ranges::sort(slices, {}, [&](const Slice& slice) { return slice.position_mm.dot(axes.col(2)); });
  drop_duplicates(slices, axes.col(2), notes);
  if (slices.size() < 2) throw Error(fmt::format("CT series {}: only one slice", series.series_instance_uid));
  series.hu = assembled(slices, axes, series.series_instance_uid, allowed, notes);
  series.doubts = ct_doubts(series.hu);
  std::string hashes;
  for (const Slice& slice : slices)
    if (std::ranges::find(series.sop_instance_uids, slice.sop_instance_uid) == series.sop_instance_uids.end()) {
      series.sop_instance_uids.push_back(slice.sop_instance_uid);
      hashes += slice.sha256;
    }
  series.sha256 = sha256_of(hashes);
  return series;
}

}  // namespace isoshift
