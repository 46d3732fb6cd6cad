#include "phantom/study_writer.h"

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>
#include <set>

#include "geometry/error.h"
#include "geometry/patient_setup.h"
#include "io/decode.h"
#include "io/output_folder.h"

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

void write_ct(const PhantomOptions& options, const StudyUids& study, Uids& uids, const std::filesystem::path& folder,
              const Progress& progress) {
  const bool is_head = options.anatomy == PhantomOptions::Anatomy::kHead;
  const Eigen::Vector3d extent_mm = is_head ? Eigen::Vector3d(190, 230, 216) : Eigen::Vector3d(320, 220, 180);
  const Eigen::Vector3d spacing_mm(options.voxel_mm, options.voxel_mm, kSliceToPixel * options.voxel_mm);
  const Eigen::Vector3i size = (extent_mm.array() / spacing_mm.array()).round().cast<int>();
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
  // Tilted slices lean against the table, which moves along z: the voxels' axes are sheared.
  const double tilt_rad = options.ct_tilt_deg * std::numbers::pi / 180.0;
  const Eigen::Vector3d along_columns(0.0, std::cos(tilt_rad), std::sin(tilt_rad));
  patient_from_voxel.linear() << Eigen::Vector3d::UnitX() * spacing_mm.x(), along_columns * spacing_mm.y(),
      Eigen::Vector3d::UnitZ() * spacing_mm.z();
  patient_from_voxel.translation() =
      options.placement.isocenter_patient_mm + (is_head ? Eigen::Vector3d(0, 0, 4) : Eigen::Vector3d(0, -25, 0)) -
      0.5 * (patient_from_voxel.linear() * Eigen::Vector3d((size.array() - 1).cast<double>()));
  const Volume<float> ct = ct_of_shapes(phantom_shapes(options), size, patient_from_voxel);

  std::filesystem::create_directories(folder);
  for (int k = 0; k < size.z(); ++k) {
    DicomFile file;
    DicomItem dataset = file.dataset();
    put_common(dataset, study.identity, UID_CTImageStorage, uids.next(), "CT", study.ct_series,
               study.frame_of_reference);
    dataset.put(DCM_ImageType, "ORIGINAL\\PRIMARY\\AXIAL");
    dataset.put(DCM_BodyPartExamined, is_head ? "HEAD" : "LSPINE");
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
  dataset.put(DCM_RTPlanGeometry, "TREATMENT_DEVICE");
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

void write_xray(const PhantomOptions& options, const StudyUids& study, const std::string& sop_instance_uid,
                std::size_t number, const std::filesystem::path& path) {
  Imager imager;
  imager.gantry_angle_deg = options.gantry_angles_deg[number];
  imager.receptor_angle_deg = options.receptor_angle_deg;
  imager.pixels = options.image_pixels;
  imager.pixel_mm = kPanelMm / options.image_pixels;
  const Image<float> intensity =
      simulate_xray(phantom_shapes(options), options.placement, imager, options.photons, options.seed * 1000 + number);
  std::vector<std::uint16_t> stored(intensity.pixels.size());
  std::ranges::transform(intensity.pixels, stored.begin(), [](float value) {
    return static_cast<std::uint16_t>(std::clamp(std::lround(kStoredAtOpen * value), 0L, 65535L));
  });

  DicomFile file;
  DicomItem dataset = file.dataset();
  put_common(dataset, study.identity, UID_RTImageStorage, sop_instance_uid, "RTIMAGE", study.image_series,
             study.image_frame_of_reference);
  const double corner_mm = 0.5 * (imager.pixels - 1) * imager.pixel_mm;
  dataset.put(DCM_ImageType, "ORIGINAL\\PRIMARY\\RADIOGRAPH");
  dataset.put(DCM_ConversionType, "DI");
  dataset.put(DCM_ContentDate, "20260301");
  dataset.put(DCM_ContentTime, fmt::format("1015{:02}", number * 10));
  dataset.put(DCM_AcquisitionDate, "20260301");
  dataset.put(DCM_AcquisitionTime, fmt::format("1015{:02}", number * 10));
  dataset.put(DCM_PatientPosition, options.placement.patient_position);
  dataset.put(DCM_InstanceNumber, fmt::format("{}", number + 1));
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
  exposure.put(DCM_KVP, 120.0);
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
  if (!(photons >= 0.0 && std::isfinite(photons)))
    throw UsageError(fmt::format("{} photons: expected 0 or more", photons));
}

std::vector<Shape> phantom_shapes(const PhantomOptions& options) {
  return options.anatomy == PhantomOptions::Anatomy::kHead
             ? head_phantom(options.placement.isocenter_patient_mm, options.seed)
             : spine_phantom(options.placement.isocenter_patient_mm, options.seed);
}

void write_phantom_study(const PhantomOptions& options, const std::filesystem::path& folder, const Progress& progress) {
  options.check();
  Uids uids(options.seed);
  const StudyUids study = make_uids(options, uids);
  write_ct(options, study, uids, folder / "CT", progress);
  write_plan(options, study, folder / "RTPLAN.dcm");
  std::filesystem::create_directories(folder / "RTIMAGE");
  for (std::size_t n = 0; n < options.gantry_angles_deg.size(); ++n)
    write_xray(options, study, uids.next(), n,
               folder / "RTIMAGE" / fmt::format("{}.dcm", image_label(options.gantry_angles_deg[n])));
  write_truth(options, folder / "truth.json");
}

}  // namespace isoshift
