#include "phantom/study_writer.h"

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <set>

#include "base/error.h"
#include "base/output_folder.h"
#include "geometry/patient_setup.h"
#include "io/dicom/decode.h"

namespace isoshift {
namespace {

constexpr double kPanelMm = 410.0;
constexpr double kSliceToPixel = 1.5;
constexpr double kStoredAtOpen = 50000.0;  // stored value of an open pixel

// The same seed gives the same UIDs, so that a study can be made again byte for byte.
class Uids {
 public:
  explicit Uids(std::uint64_t seed) : random_(seed) {}
  std::string next() {
    std::array<std::uint8_t, 16> bytes{};
    std::ranges::generate(bytes, [&] { return static_cast<std::uint8_t>(random_()); });
    return uid_from_random_bytes(bytes);
  }

 private:
  std::mt19937_64 random_;
};

struct StudyUids {
  Identity identity;
  std::string ct_series, frame_of_reference, plan, plan_series, image_series, image_frame_of_reference;
  std::string structures;                 // of a thorax
  std::vector<std::string> ct_instances;  // of the planning CT
};

// The CT's voxels, as large as the body.
struct CtLattice {
  Eigen::Vector3i size;
  Eigen::Vector3d spacing_mm, along_columns;
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
};

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

void put_common(DicomItem dataset, const Identity& identity, const char* sop_class, const std::string& sop_instance,
                const char* modality, const std::string& series, const std::string& frame_of_reference) {
  put_identity(dataset, identity);
  dataset.put(DCM_SOPClassUID, sop_class);
  dataset.put(DCM_SOPInstanceUID, sop_instance);
  dataset.put(DCM_Modality, modality);
  dataset.put(DCM_SeriesInstanceUID, series);
  dataset.put(DCM_SeriesNumber, "1");
  dataset.put(DCM_FrameOfReferenceUID, frame_of_reference);
  dataset.put(DCM_PositionReferenceIndicator, "");
  dataset.put(DCM_Manufacturer, "isoshift phantom");
  dataset.put(DCM_OperatorsName, "");
}

struct Body {
  Eigen::Vector3d extent_mm, center_from_isocenter_mm;
  const char* part;  // BodyPartExamined
};

Body body_of(PhantomOptions::Anatomy anatomy) {
  switch (anatomy) {
    case PhantomOptions::Anatomy::kHead: return {{190, 230, 216}, {0, 0, 4}, "HEAD"};
    case PhantomOptions::Anatomy::kSpine: return {{320, 220, 180}, {0, -25, 0}, "LSPINE"};
    case PhantomOptions::Anatomy::kThorax: return {{350, 250, 210}, {65, 10, 0}, "CHEST"};
  }
  return {};
}

CtLattice lattice_of(const PhantomOptions& options) {
  const Body body = body_of(options.anatomy);
  CtLattice lattice;
  lattice.spacing_mm = Eigen::Vector3d(options.voxel_mm, options.voxel_mm, kSliceToPixel * options.voxel_mm);
  lattice.size = (body.extent_mm.array() / lattice.spacing_mm.array()).round().cast<int>();
  // Tilted slices lean against the table, which moves along z: the voxels' axes are sheared.
  const double tilt_rad = options.ct_tilt_deg * std::numbers::pi / 180.0;
  lattice.along_columns = Eigen::Vector3d(0.0, std::cos(tilt_rad), std::sin(tilt_rad));
  lattice.patient_from_voxel.linear() << Eigen::Vector3d::UnitX() * lattice.spacing_mm.x(),
      lattice.along_columns * lattice.spacing_mm.y(), Eigen::Vector3d::UnitZ() * lattice.spacing_mm.z();
  lattice.patient_from_voxel.translation() =
      options.placement.isocenter_patient_mm + body.center_from_isocenter_mm -
      0.5 * (lattice.patient_from_voxel.linear() * Eigen::Vector3d((lattice.size.array() - 1).cast<double>()));
  return lattice;
}

// Returns the UIDs of the slices.
std::vector<std::string> write_ct(const PhantomOptions& options, const StudyUids& study, const std::string& series_uid,
                                  const Eigen::Vector3d& displacement_mm, Uids& uids,
                                  const std::filesystem::path& folder, const Progress& progress) {
  std::vector<std::string> instances;
  const auto& [size, spacing_mm, along_columns, patient_from_voxel] = lattice_of(options);
  const Volume<float> ct = ct_of_shapes(phantom_shapes(options, displacement_mm), size, patient_from_voxel);

  std::filesystem::create_directories(folder);
  for (int k = 0; k < size.z(); ++k) {
    DicomFile file;
    DicomItem dataset = file.dataset();
    instances.push_back(uids.next());
    put_common(dataset, study.identity, UID_CTImageStorage, instances.back(), "CT", series_uid,
               study.frame_of_reference);
    dataset.put(DCM_ImageType, "ORIGINAL\\PRIMARY\\AXIAL");
    dataset.put(DCM_BodyPartExamined, body_of(options.anatomy).part);
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

void put_beam(DicomItem beam, const PhantomOptions& options, int number, const std::string& name, double gantry_deg) {
  beam.put(DCM_TreatmentMachineName, "PHANTOM");
  beam.put(DCM_PrimaryDosimeterUnit, "MU");
  beam.put(DCM_SourceAxisDistance, Imager{}.sad_mm);
  beam.put_empty_sequence(DCM_BeamLimitingDeviceSequence);
  beam.put(DCM_BeamNumber, number);
  beam.put(DCM_BeamName, name);
  beam.put(DCM_BeamType, "STATIC");
  beam.put(DCM_RadiationType, "PHOTON");
  beam.put(DCM_TreatmentDeliveryType, "SETUP");
  for (const DcmTagKey& count : {DCM_NumberOfWedges, DCM_NumberOfCompensators, DCM_NumberOfBoli, DCM_NumberOfBlocks})
    beam.put(count, 0);
  beam.put(DCM_FinalCumulativeMetersetWeight, 0.0);
  beam.put(DCM_NumberOfControlPoints, 1);
  DicomItem point = beam.append_item(DCM_ControlPointSequence);
  point.put(DCM_ControlPointIndex, 0);
  point.put(DCM_CumulativeMetersetWeight, 0.0);
  point.put(DCM_GantryAngle, gantry_deg);
  point.put(DCM_GantryRotationDirection, "NONE");
  point.put(DCM_BeamLimitingDeviceAngle, 0.0);
  point.put(DCM_BeamLimitingDeviceRotationDirection, "NONE");
  point.put(DCM_PatientSupportAngle, options.placement.couch_angle_deg);
  point.put(DCM_PatientSupportRotationDirection, "NONE");
  point.put(DCM_TableTopEccentricAngle, 0.0);
  point.put(DCM_TableTopEccentricRotationDirection, "NONE");
  point.put(DCM_IsocenterPosition, std::span(options.placement.isocenter_patient_mm.data(), 3));
  beam.put(DCM_ReferencedPatientSetupNumber, 1);
}

void write_plan(const PhantomOptions& options, const StudyUids& study, const std::filesystem::path& path) {
  DicomFile file;
  DicomItem dataset = file.dataset();
  put_common(dataset, study.identity, UID_RTPlanStorage, study.plan, "RTPLAN", study.plan_series,
             study.frame_of_reference);
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
  DicomItem group = dataset.append_item(DCM_FractionGroupSequence);
  group.put(DCM_FractionGroupNumber, 1);
  group.put(DCM_NumberOfFractionsPlanned, 1);
  group.put(DCM_NumberOfBeams, static_cast<double>(options.gantry_angles_deg.size()));
  group.put(DCM_NumberOfBrachyApplicationSetups, 0);
  for (std::size_t n = 0; n < options.gantry_angles_deg.size(); ++n) {
    group.append_item(DCM_ReferencedBeamSequence).put(DCM_ReferencedBeamNumber, static_cast<double>(n + 1));
    put_beam(dataset.append_item(DCM_BeamSequence), options, static_cast<int>(n + 1),
             image_label(options.gantry_angles_deg[n]), options.gantry_angles_deg[n]);
  }
  DicomItem setup = dataset.append_item(DCM_PatientSetupSequence);
  setup.put(DCM_PatientSetupNumber, 1);
  setup.put(DCM_PatientPosition, options.placement.patient_position);
  file.write(path);
}

// The moment of an X-ray and what is different then.
struct Moment {
  double time_s = 0.0;  // after 10:15
  int instance = 1;
  Eigen::Vector3d displacement_mm = Eigen::Vector3d::Zero();
  std::uint64_t noise_seed = 0;
  int day = 1;  // of March 2026
};

// TM with fractions where there are any.
std::string time_of_day(double after_1015_s) {
  const auto microseconds = std::llround(after_1015_s * 1e6);
  const long long seconds = 15 * 60 + microseconds / 1'000'000, fraction = microseconds % 1'000'000;
  const std::string whole = fmt::format("{:02}{:02}{:02}", 10 + seconds / 3600, seconds / 60 % 60, seconds % 60);
  return fraction == 0 ? whole : fmt::format("{}.{:06}", whole, fraction);
}

void write_xray(const PhantomOptions& options, const StudyUids& study, const std::string& sop_instance_uid,
                std::size_t number, const Moment& moment, const std::filesystem::path& path) {
  Imager imager;
  const auto& mv = options.megavoltage_angles_deg;
  imager.is_megavoltage = std::ranges::find(mv, options.gantry_angles_deg[number]) != mv.end();
  imager.gantry_angle_deg = options.gantry_angles_deg[number];
  imager.receptor_angle_deg = options.receptor_angle_deg;
  imager.pixels = options.image_pixels;
  imager.pixel_mm = kPanelMm / options.image_pixels;
  const Image<float> intensity = simulate_xray(phantom_shapes(options, moment.displacement_mm), options.placement,
                                               imager, options.photons, moment.noise_seed);
  std::vector<std::uint16_t> stored(intensity.pixels.size());
  std::ranges::transform(intensity.pixels, stored.begin(), [](float value) {
    return static_cast<std::uint16_t>(std::clamp(std::lround(kStoredAtOpen * value), 0L, 65535L));
  });

  DicomFile file;
  DicomItem dataset = file.dataset();
  put_common(dataset, study.identity, UID_RTImageStorage, sop_instance_uid, "RTIMAGE", study.image_series,
             study.image_frame_of_reference);
  const double corner_mm = 0.5 * (imager.pixels - 1) * imager.pixel_mm;
  dataset.put(DCM_ImageType, imager.is_megavoltage ? "ORIGINAL\\PRIMARY\\PORTAL" : "ORIGINAL\\PRIMARY\\RADIOGRAPH");
  dataset.put(DCM_ConversionType, "DI");
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
  DicomItem exposure = dataset.append_item(DCM_ExposureSequence);
  exposure.put(DCM_KVP, imager.is_megavoltage ? 6000.0 : 120.0);
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

void write_truth(const PhantomOptions& options, const std::filesystem::path& path) {
  const Placement& placement = options.placement;
  const Eigen::Matrix3d rotation = placement.rotation();
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (int row = 0; row < 3; ++row) rows.push_back({rotation(row, 0), rotation(row, 1), rotation(row, 2)});
  const auto list = [](const Eigen::Vector3d& v) { return nlohmann::ordered_json{v.x(), v.y(), v.z()}; };
  const nlohmann::ordered_json truth = {
      {"isocenter_patient_mm", list(placement.isocenter_patient_mm)},
      {"patient_position", placement.patient_position},
      {"couch_deg", placement.couch_angle_deg},
      {"setup_error_room",
       {{"translation_mm", list(placement.translation_mm)},
        {"rotation_deg_rx_ry_rz", list(placement.rotation_deg)},
        {"rotation_matrix", rows},
        {"means", "anatomy planned at x (IEC 61217 fixed, mm from the isocenter) is found at R x + t; R = Rz Rx Ry"}}}};
  write_text(path, truth.dump(1) + "\n");
}

// The target at the end of expiration, a circle per slice.
void write_structures(const PhantomOptions& options, const StudyUids& study, Uids& uids,
                      const std::filesystem::path& path) {
  DicomFile file;
  DicomItem dataset = file.dataset();
  put_common(dataset, study.identity, UID_RTStructureSetStorage, study.structures, "RTSTRUCT", uids.next(),
             study.frame_of_reference);
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
  DicomItem roi = dataset.append_item(DCM_StructureSetROISequence);
  roi.put(DCM_ROINumber, 1);
  roi.put(DCM_ReferencedFrameOfReferenceUID, study.frame_of_reference);
  roi.put(DCM_ROIName, "Target");
  roi.put(DCM_ROIGenerationAlgorithm, "AUTOMATIC");
  DicomItem drawn = dataset.append_item(DCM_ROIContourSequence);
  drawn.put(DCM_ReferencedROINumber, 1);
  const CtLattice lattice = lattice_of(options);
  const Eigen::Vector3d& center_mm = options.placement.isocenter_patient_mm;
  for (int k = 0; k < lattice.size.z(); ++k) {
    const double z = (lattice.patient_from_voxel * Eigen::Vector3d(0, 0, k)).z() - center_mm.z();
    if (std::abs(z) >= kTargetRadiusMm) continue;
    const double radius_mm = std::sqrt(kTargetRadiusMm * kTargetRadiusMm - z * z);
    constexpr int kPoints = 36;
    std::vector<double> points;
    for (int n = 0; n < kPoints; ++n) {
      const double angle = 2.0 * std::numbers::pi * n / kPoints;
      const Eigen::Vector3d point =
          center_mm + Eigen::Vector3d(radius_mm * std::cos(angle), radius_mm * std::sin(angle), z);
      points.insert(points.end(), {point.x(), point.y(), point.z()});
    }
    DicomItem contour = drawn.append_item(DCM_ContourSequence);
    contour.put(DCM_ContourGeometricType, "CLOSED_PLANAR");
    contour.put(DCM_NumberOfContourPoints, kPoints);
    contour.put(DCM_ContourData, points);
  }
  DicomItem observation = dataset.append_item(DCM_RTROIObservationsSequence);
  observation.put(DCM_ObservationNumber, 1);
  observation.put(DCM_ReferencedROINumber, 1);
  observation.put(DCM_RTROIInterpretedType, "GTV");
  observation.put(DCM_ROIInterpreter, "");
  dataset.put(DCM_ApprovalStatus, "UNAPPROVED");
  file.write(path);
}

// The 4D CT and the X-rays of all moments, with the truth of each.
void write_breathing(const PhantomOptions& options, const StudyUids& study, Uids& uids,
                     const std::filesystem::path& folder, const Progress& progress) {
  const BreathingOptions& breathing = options.breathing;
  const Breathing motion(breathing, options.seed);
  for (int phase = 0; phase < breathing.phases; ++phase) {
    const std::filesystem::path path = folder / "PHASES" / fmt::format("{:02}", phase);
    std::filesystem::create_directories(path);
    write_ct(options, study, uids.next(),
             Breathing::phase_displacement_mm(static_cast<double>(phase) / breathing.phases), uids, path, {});
  }
  const Placement& placement = options.placement;
  const Eigen::Vector3d planned_mm = placement.isocenter_patient_mm;
  Placement as_planned = placement;
  as_planned.translation_mm.setZero();
  as_planned.rotation_deg.setZero();
  std::string truth = "t_s,x_mm,y_mm,z_mm\n";
  std::filesystem::create_directories(folder / "RTIMAGE");
  const int moments = static_cast<int>(breathing.seconds * breathing.rate_hz);
  const auto imagers = options.gantry_angles_deg.size();
  for (int n = 0; n < moments; ++n) {
    Moment moment{.time_s = n / breathing.rate_hz, .instance = n + 1, .displacement_mm = {}, .noise_seed = 0};
    moment.displacement_mm = motion.displacement_mm(moment.time_s);
    const Eigen::Vector3d moved_mm =
        placement.fixed_from_patient(planned_mm + moment.displacement_mm) - as_planned.fixed_from_patient(planned_mm);
    truth += fmt::format("{:.4f},{:.6f},{:.6f},{:.6f}\n", moment.time_s, moved_mm.x(), moved_mm.y(), moved_mm.z());
    for (std::size_t imager = 0; imager < imagers; ++imager) {
      moment.noise_seed = (options.seed * 1000 + imager) * 1'000'003 + static_cast<std::uint64_t>(n);
      write_xray(
          options, study, uids.next(), imager, moment,
          folder / "RTIMAGE" / fmt::format("{}_{:05}.dcm", image_label(options.gantry_angles_deg[imager]), n + 1));
    }
    if (progress) progress(static_cast<std::size_t>(n) + 1, static_cast<std::size_t>(moments));
  }
  write_text(folder / "truth.csv", truth);
}

// The session of a day: an X-ray at each gantry angle.
void write_session(const PhantomOptions& options, const StudyUids& study, Uids& uids, int day,
                   const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  const std::uint64_t seed = (options.seed + static_cast<std::uint64_t>(day - 1) * 1'000'003) * 1000;
  for (std::size_t n = 0; n < options.gantry_angles_deg.size(); ++n)
    write_xray(options, study, uids.next(), n,
               {.time_s = 10.0 * static_cast<double>(n),
                .instance = static_cast<int>(n + 1),
                .displacement_mm = Eigen::Vector3d::Zero(),
                .noise_seed = seed + n,
                .day = day},
               folder / fmt::format("{}.dcm", image_label(options.gantry_angles_deg[n])));
}

void write_later_fractions(const PhantomOptions& options, const StudyUids& study, Uids& uids,
                           const std::filesystem::path& folder) {
  std::mt19937_64 random(options.seed);
  std::normal_distribution<double> translation(0.0, 2.0), rotation(0.0, 0.7);
  for (int fraction = 2; fraction <= options.fractions; ++fraction) {
    PhantomOptions of_day = options;
    for (double& mm : of_day.placement.translation_mm) mm += translation(random);
    for (double& deg : of_day.placement.rotation_deg) deg += rotation(random);
    const std::string name = fmt::format("F{:02}", fraction);
    write_session(of_day, study, uids, fraction, folder / "RTIMAGE" / name);
    write_truth(of_day, folder / fmt::format("truth_{}.json", name));
  }
}

}  // namespace

void PhantomOptions::check() const {
  if (!patient_position_from(placement.patient_position))
    throw UsageError(fmt::format("patient position {} is not one of HFS, HFP, FFS, FFP, HFDR, HFDL, FFDR, FFDL",
                                 placement.patient_position));
  if (!(voxel_mm >= 0.5 && voxel_mm <= 5.0))
    throw UsageError(fmt::format("voxel size {} mm is not within 0.5 to 5", voxel_mm));
  if (image_pixels < 64 || image_pixels > 2048)
    throw UsageError(fmt::format("{} image pixels are not within 64 to 2048", image_pixels));
  if (gantry_angles_deg.empty() || gantry_angles_deg.size() > 6) throw UsageError("1 to 6 gantry angles are needed");
  std::set<std::string> labels;
  for (const double angle_deg : gantry_angles_deg)
    if (!std::isfinite(angle_deg) || !labels.insert(image_label(angle_deg)).second)
      throw UsageError(fmt::format("gantry angle {}: expected finite angles, a degree or more apart", angle_deg));
  if (!placement.translation_mm.allFinite() || !placement.rotation_deg.allFinite() ||
      !std::isfinite(placement.couch_angle_deg) || !std::isfinite(receptor_angle_deg))
    throw UsageError("the setup error, the couch angle and the receptor angle must be finite numbers");
  if (!(std::abs(ct_tilt_deg) <= 30.0))
    throw UsageError(fmt::format("a CT tilt of {} degrees is not within 30", ct_tilt_deg));
  if (breathing.seconds != 0.0 && anatomy != Anatomy::kThorax)
    throw UsageError("only a thorax breathes: --anatomy thorax");
  if (!(breathing.seconds >= 0.0 && breathing.seconds <= 7200.0) ||
      !(breathing.rate_hz >= 0.1 && breathing.rate_hz <= 50.0))
    throw UsageError(fmt::format("{} s of breathing at {} Hz: expected at most 7200 s at 0.1 to 50 Hz",
                                 breathing.seconds, breathing.rate_hz));
  if (fractions < 1 || fractions > 31 || (fractions > 1 && breathing.seconds > 0.0))
    throw UsageError(fmt::format("{} fractions: expected 1 to 31, and one of a phantom that breathes", fractions));
  for (const double angle_deg : megavoltage_angles_deg)
    if (std::ranges::find(gantry_angles_deg, angle_deg) == gantry_angles_deg.end())
      throw UsageError(fmt::format("no X-ray is taken at gantry angle {}, which is to be MV", angle_deg));
  if (!(photons >= 0.0 && std::isfinite(photons)))
    throw UsageError(fmt::format("{} photons: expected 0 or more", photons));
}

std::vector<Shape> phantom_shapes(const PhantomOptions& options, const Eigen::Vector3d& target_displacement_mm) {
  const Eigen::Vector3d& isocenter = options.placement.isocenter_patient_mm;
  switch (options.anatomy) {
    case PhantomOptions::Anatomy::kHead: return head_phantom(isocenter, options.seed);
    case PhantomOptions::Anatomy::kSpine: return spine_phantom(isocenter, options.seed);
    case PhantomOptions::Anatomy::kThorax: return thorax_phantom(isocenter, options.seed, target_displacement_mm);
  }
  return {};
}

void write_phantom_study(const PhantomOptions& options, const std::filesystem::path& folder, const Progress& progress) {
  options.check();
  Uids uids(options.seed);
  StudyUids study = make_uids(options, uids);
  const bool breathes = options.breathing.seconds > 0.0;
  study.ct_instances = write_ct(options, study, study.ct_series, Eigen::Vector3d::Zero(), uids, folder / "CT",
                                breathes ? Progress() : progress);
  if (options.anatomy == PhantomOptions::Anatomy::kThorax) study.structures = uids.next();
  write_plan(options, study, folder / "RTPLAN.dcm");
  if (!breathes) write_session(options, study, uids, 1, folder / "RTIMAGE");
  if (options.anatomy == PhantomOptions::Anatomy::kThorax)
    write_structures(options, study, uids, folder / "RTSTRUCT.dcm");
  if (breathes) write_breathing(options, study, uids, folder, progress);
  write_later_fractions(options, study, uids, folder);
  write_truth(options, folder / "truth.json");
}

}  // namespace isoshift
