#include "phantom/study_objects.h"

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "io/dicom/decode.h"
#include "phantom/dicom/setup_items.h"

namespace isoshift {
namespace {

constexpr double kPanelMm = 410.0;
constexpr double kSliceToPixel = 1.5;
constexpr double kStoredAtOpen = 50000.0;  // stored value of an open pixel

// The CT's voxels, as large as the body.
struct CtLattice {
  Eigen::Vector3i size;
  Eigen::Vector3d spacing_mm, along_columns;
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
};

constexpr const char* kManufacturer = "isoshift phantom";

struct ScannedPart {
  Eigen::Vector3d extent_mm, center_from_isocenter_mm;
  const char* name;  // BodyPartExamined
};

ScannedPart part_of(PhantomOptions::Anatomy anatomy) {
  switch (anatomy) {
    case PhantomOptions::Anatomy::kHead: return {{190, 230, 216}, {0, 0, 4}, "HEAD"};
    case PhantomOptions::Anatomy::kSpine: return {{320, 220, 180}, {0, -25, 0}, "LSPINE"};
    case PhantomOptions::Anatomy::kThorax: return {{350, 250, 210}, {65, 10, 0}, "CHEST"};
    case PhantomOptions::Anatomy::kBalls: return {{186, 186, 186}, {0, 0, 0}, "PHANTOM"};
  }
  return {};
}

// A ball about the isocenter: a tumor in the lung, a part of the skull's vault or a vertebra and its margin.
struct DrawnTarget {
  const char *name, *interpreted_type;
  double radius_mm;
};

DrawnTarget target_of(PhantomOptions::Anatomy anatomy) {
  switch (anatomy) {
    case PhantomOptions::Anatomy::kHead: return {"PTV", "PTV", 25.0};
    case PhantomOptions::Anatomy::kSpine:
    case PhantomOptions::Anatomy::kBalls: return {"PTV", "PTV", 20.0};
    case PhantomOptions::Anatomy::kThorax: return {"Target", "GTV", kTargetRadiusMm};
  }
  return {};
}

CtLattice lattice_of(const PhantomOptions& options) {
  const ScannedPart part = part_of(options.anatomy);
  CtLattice lattice;
  lattice.spacing_mm = Eigen::Vector3d(options.voxel_mm, options.voxel_mm, kSliceToPixel * options.voxel_mm);
  lattice.size = (part.extent_mm.array() / lattice.spacing_mm.array()).round().cast<int>();
  // Tilted slices lean against the table, which moves along z: the voxels' axes are sheared.
  const double tilt_rad = options.ct_tilt_deg * std::numbers::pi / 180.0;
  lattice.along_columns = Eigen::Vector3d(0.0, std::cos(tilt_rad), std::sin(tilt_rad));
  lattice.patient_from_voxel.linear() << Eigen::Vector3d::UnitX() * lattice.spacing_mm.x(),
      lattice.along_columns * lattice.spacing_mm.y(), Eigen::Vector3d::UnitZ() * lattice.spacing_mm.z();
  lattice.patient_from_voxel.translation() =
      options.placement.isocenter_patient_mm + part.center_from_isocenter_mm -
      0.5 * (lattice.patient_from_voxel.linear() * Eigen::Vector3d((lattice.size.array() - 1).cast<double>()));
  return lattice;
}

// TM with fractions where there are any.
std::string time_of_day(double after_1015_s) {
  const auto microseconds = std::llround(after_1015_s * 1e6);
  const long long seconds = 15 * 60 + microseconds / 1'000'000, fraction = microseconds % 1'000'000;
  const std::string whole = fmt::format("{:02}{:02}{:02}", 10 + seconds / 3600, seconds / 60 % 60, seconds % 60);
  return fraction == 0 ? whole : fmt::format("{}.{:06}", whole, fraction);
}

void put_exposure(DicomItem dataset, const Imager& imager) {
  DicomItem exposure = dataset.append_item(DCM_ExposureSequence);
  exposure.put(DCM_KVP, imager.is_megavoltage ? 6000.0 : 120.0);
  exposure.put(DCM_NumberOfBlocks, 0);
}

}  // namespace

std::string Uids::next() {
  std::array<std::uint8_t, 16> bytes{};
  std::ranges::generate(bytes, [&] { return static_cast<std::uint8_t>(random_()); });
  return uid_from_random_bytes(bytes);
}

StudyUids make_uids(const PhantomOptions& options, Uids& uids) {
  StudyUids study;
  study.identity = {.character_set = "ISO_IR 192",
                    .patient_id = fmt::format("PHANTOM{}", options.seed),
                    .patient_name = "Phantom^Digital",
                    .patient_sex = "O",
                    .study_instance_uid = uids.next(),
                    .study_date = "20260301",
                    .study_time = "080000",
                    .study_id = "1"};
  study.ct_series = uids.next();
  study.frame_of_reference = uids.next();
  study.plan = uids.next();
  study.plan_series = uids.next();
  study.image_series = uids.next();
  study.image_frame_of_reference = uids.next();
  return study;
}

std::vector<std::string> write_ct(const PhantomOptions& options, const StudyUids& study, const std::string& series_uid,
                                  const Eigen::Vector3d& displacement_mm, Uids& uids,
                                  const std::filesystem::path& folder, const Progress& progress) {
  std::vector<std::string> instances;
  const auto& [size, spacing_mm, along_columns, patient_from_voxel] = lattice_of(options);
  const Volume<float> ct = ct_of_shapes(phantom_of(options, displacement_mm).in_ct, size, patient_from_voxel);

  std::filesystem::create_directories(folder);
  for (int k = 0; k < size.z(); ++k) {
    DicomFile file;
    DicomItem dataset = file.dataset();
    instances.push_back(uids.next());
    put_common(dataset, study.identity,
               {UID_CTImageStorage, instances.back(), "CT", series_uid, study.frame_of_reference}, kManufacturer);
    dataset.put(DCM_ImageType, "ORIGINAL\\PRIMARY\\AXIAL");
    dataset.put(DCM_BodyPartExamined, part_of(options.anatomy).name);
    dataset.put(DCM_PatientPosition, options.placement.patient_position);
    dataset.put(DCM_KVP, 120.0);
    dataset.put(DCM_AcquisitionNumber, "1");
    dataset.put(DCM_InstanceNumber, fmt::format("{}", k + 1));
    dataset.put(DCM_ImagePositionPatient,
                std::span(Eigen::Vector3d(patient_from_voxel * Eigen::Vector3d(0, 0, k)).data(), 3));
    dataset.put(DCM_ImageOrientationPatient,
                std::array{1.0, 0.0, 0.0, along_columns.x(), along_columns.y(), along_columns.z()});
    dataset.put(DCM_PixelSpacing, std::array{spacing_mm.y(), spacing_mm.x()});
    dataset.put(DCM_SliceThickness, spacing_mm.z());
    put_pixel_format(dataset, {.columns = size.x(), .rows = size.y(), .is_signed = true});
    dataset.put(DCM_RescaleIntercept, 0.0);
    dataset.put(DCM_RescaleSlope, 1.0);
    dataset.put(DCM_RescaleType, "HU");
    std::vector<std::uint16_t> stored;
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i)
        stored.push_back(static_cast<std::uint16_t>(static_cast<std::int16_t>(std::lround(ct.at(i, j, k)))));
    dataset.put_pixels(stored);
    file.write(folder / fmt::format("CT{:04}.dcm", k));
    if (progress) progress(static_cast<std::size_t>(k) + 1, static_cast<std::size_t>(size.z()));
  }
  return instances;
}

std::string image_label(double gantry_angle_deg) { return fmt::format("KV_G{:03.0f}", gantry_angle_deg); }

void write_plan(const PhantomOptions& options, const StudyUids& study, const std::filesystem::path& path) {
  DicomFile file;
  DicomItem dataset = file.dataset();
  put_common(dataset, study.identity,
             {UID_RTPlanStorage, study.plan, "RTPLAN", study.plan_series, study.frame_of_reference}, kManufacturer);
  dataset.put(DCM_RTPlanLabel, "SETUP");
  dataset.put(DCM_RTPlanDate, "20260228");
  dataset.put(DCM_RTPlanTime, "090000");
  dataset.put(DCM_RTPlanGeometry, study.structures.empty() ? "TREATMENT_DEVICE" : "PATIENT");
  if (!study.structures.empty())
    dataset.append_reference(DCM_ReferencedStructureSetSequence, UID_RTStructureSetStorage, study.structures);
  dataset.put(DCM_ApprovalStatus, "APPROVED");
  dataset.put(DCM_ReviewDate, "20260228");
  dataset.put(DCM_ReviewTime, "100000");
  dataset.put(DCM_ReviewerName, "Nobody^Real");
  if (!options.bends.empty()) put_target_reference(dataset);
  DicomItem group = dataset.append_item(DCM_FractionGroupSequence);
  group.put(DCM_FractionGroupNumber, 1);
  group.put(DCM_NumberOfFractionsPlanned, 1);
  group.put(DCM_NumberOfBeams, static_cast<double>(options.gantry_angles_deg.size()));
  group.put(DCM_NumberOfBrachyApplicationSetups, 0);
  for (std::size_t n = 0; n < options.gantry_angles_deg.size(); ++n) {
    group.append_item(DCM_ReferencedBeamSequence).put(DCM_ReferencedBeamNumber, static_cast<double>(n + 1));
    put_setup_beam(dataset.append_item(DCM_BeamSequence),
                   {.machine = "PHANTOM",
                    .sad_mm = Imager{}.sad_mm,
                    .number = static_cast<int>(n + 1),
                    .name = image_label(options.gantry_angles_deg[n]),
                    .gantry_deg = options.gantry_angles_deg[n],
                    .couch_deg = options.placement.couch_angle_deg,
                    .isocenter_patient_mm = options.placement.isocenter_patient_mm});
  }
  DicomItem setup = dataset.append_item(DCM_PatientSetupSequence);
  setup.put(DCM_PatientSetupNumber, 1);
  setup.put(DCM_PatientPosition, options.placement.patient_position);
  file.write(path);
}

void write_xray(const PhantomOptions& options, const StudyUids& study, const std::string& sop_instance_uid,
                std::size_t number, const Moment& moment, const std::filesystem::path& path) {
  Imager imager;
  const auto& mv = options.megavoltage_angles_deg;
  imager.is_megavoltage = std::ranges::find(mv, options.gantry_angles_deg[number]) != mv.end();
  imager.gantry_angle_deg = options.gantry_angles_deg[number];
  imager.receptor_angle_deg = options.receptor_angle_deg;
  imager.fault = options.panel_fault;
  imager.pixels = options.image_pixels;
  imager.pixel_mm = kPanelMm / options.image_pixels;
  const Image<float> intensity = simulate_xray(phantom_of(options, moment.displacement_mm).in_xrays, options.placement,
                                               imager, options.photons, moment.noise_seed);
  std::vector<std::uint16_t> stored(intensity.pixels.size());
  std::ranges::transform(intensity.pixels, stored.begin(), [](float value) {
    return static_cast<std::uint16_t>(std::clamp(std::lround(kStoredAtOpen * value), 0L, 65535L));
  });

  DicomFile file;
  DicomItem dataset = file.dataset();
  put_common(dataset, study.identity,
             {UID_RTImageStorage, sop_instance_uid, "RTIMAGE", study.image_series, study.image_frame_of_reference},
             kManufacturer);
  const double corner_mm = 0.5 * (imager.pixels - 1) * imager.pixel_mm;
  dataset.put(DCM_ImageType, imager.is_megavoltage ? "ORIGINAL\\PRIMARY\\PORTAL" : "ORIGINAL\\PRIMARY\\RADIOGRAPH");
  dataset.put(DCM_ConversionType, "DI");
  dataset.put(DCM_PatientOrientation, "");
  const std::string date = fmt::format("202603{:02}", moment.day);
  dataset.put(DCM_ContentDate, date);
  dataset.put(DCM_ContentTime, time_of_day(moment.time_s));
  dataset.put(DCM_AcquisitionDate, date);
  dataset.put(DCM_AcquisitionTime, time_of_day(moment.time_s));
  dataset.put(DCM_PatientPosition, options.placement.patient_position);
  dataset.put(DCM_InstanceNumber, fmt::format("{}", moment.instance));
  dataset.put(DCM_RTImageLabel, image_label(imager.gantry_angle_deg));
  dataset.put(DCM_ReportedValuesOrigin, "ACTUAL");
  dataset.put(DCM_RTImagePlane, "NORMAL");
  dataset.put(DCM_XRayImageReceptorTranslation, std::array{0.0, 0.0, imager.sad_mm - imager.sid_mm});
  dataset.put(DCM_XRayImageReceptorAngle, options.receptor_angle_deg);
  dataset.put(DCM_RTImageOrientation, "1\\0\\0\\0\\-1\\0");
  dataset.put(DCM_ImagePlanePixelSpacing, std::array{imager.pixel_mm, imager.pixel_mm});
  dataset.put(DCM_RTImagePosition, std::array{-corner_mm, corner_mm});
  dataset.put(DCM_RadiationMachineName, "PHANTOM");
  dataset.put(DCM_PrimaryDosimeterUnit, "MU");
  dataset.put(DCM_RadiationMachineSAD, imager.sad_mm);
  dataset.put(DCM_RTImageSID, imager.sid_mm);
  dataset.put(DCM_GantryAngle, imager.gantry_angle_deg);
  dataset.put(DCM_BeamLimitingDeviceAngle, 0.0);
  dataset.put(DCM_PatientSupportAngle, options.placement.couch_angle_deg);
  dataset.put(DCM_TableTopPitchAngle, 0.0);
  dataset.put(DCM_TableTopRollAngle, 0.0);
  put_exposure(dataset, imager);
  dataset.append_reference(DCM_ReferencedRTPlanSequence, UID_RTPlanStorage, study.plan);
  dataset.put(DCM_ReferencedBeamNumber, fmt::format("{}", number + 1));
  put_pixel_format(dataset, {.columns = imager.pixels, .rows = imager.pixels});
  dataset.put(DCM_PixelIntensityRelationship, "LIN");
  dataset.put(DCM_PixelIntensityRelationshipSign, 1);
  dataset.put(DCM_RescaleIntercept, 0.0);
  dataset.put(DCM_RescaleSlope, 1.0);
  dataset.put(DCM_RescaleType, "US");
  dataset.put_pixels(stored);
  file.write(path);
}

void write_structures(const PhantomOptions& options, const StudyUids& study, Uids& uids,
                      const std::filesystem::path& path) {
  const DrawnTarget target = target_of(options.anatomy);
  DicomFile file;
  DicomItem dataset = file.dataset();
  put_common(dataset, study.identity,
             {UID_RTStructureSetStorage, study.structures, "RTSTRUCT", uids.next(), study.frame_of_reference},
             kManufacturer);
  dataset.put(DCM_StructureSetLabel, "TARGET");
  dataset.put(DCM_StructureSetDate, "20260228");
  dataset.put(DCM_StructureSetTime, "090000");
  DicomItem frame = dataset.append_item(DCM_ReferencedFrameOfReferenceSequence);
  frame.put(DCM_FrameOfReferenceUID, study.frame_of_reference);
  DicomItem of_study = frame.append_reference(
      DCM_RTReferencedStudySequence, UID_RETIRED_DetachedStudyManagementSOPClass, study.identity.study_instance_uid);
  DicomItem series = of_study.append_item(DCM_RTReferencedSeriesSequence);
  series.put(DCM_SeriesInstanceUID, study.ct_series);
  for (const std::string& instance : study.ct_instances)
    series.append_reference(DCM_ContourImageSequence, UID_CTImageStorage, instance);
  const CtLattice lattice = lattice_of(options);
  const Eigen::Vector3d normal = Eigen::Vector3d::UnitX().cross(lattice.along_columns);
  std::vector<double> slices_mm;
  slices_mm.reserve(static_cast<std::size_t>(lattice.size.z()));
  for (int k = 0; k < lattice.size.z(); ++k)
    slices_mm.push_back(normal.dot(lattice.patient_from_voxel * Eigen::Vector3d(0, 0, k)));
  put_ball_target(dataset,
                  {.name = target.name,
                   .interpreted_type = target.interpreted_type,
                   .center_patient_mm = options.placement.isocenter_patient_mm,
                   .radius_mm = target.radius_mm,
                   .contour_points = 36,
                   .slice_normal = normal},
                  study.frame_of_reference, slices_mm, target.radius_mm);
  dataset.put(DCM_ApprovalStatus, "UNAPPROVED");
  file.write(path);
}

}  // namespace isoshift
