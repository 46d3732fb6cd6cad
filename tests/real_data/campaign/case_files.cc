#include "tests/real_data/campaign/case_files.h"

#include <dcmtk/dcmdata/dcuid.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "io/dicom/decode.h"
#include "phantom/dicom/setup_items.h"

namespace isoshift::campaign {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Json = nlohmann::ordered_json;

struct CaseUids {
  std::string plan, plan_series, structures, structures_series, image_series, image_frame;
  std::vector<std::string> images;
};

CaseUids make_uids(const CasePlan& plan) {
  std::mt19937_64 random(plan.seed * 2 + (plan.anatomy == "head" ? 1 : 0));
  const auto next = [&] {
    std::array<std::uint8_t, 16> bytes{};
    std::ranges::generate(bytes, [&] { return static_cast<std::uint8_t>(random()); });
    return uid_from_random_bytes(bytes);
  };
  CaseUids uids;
  for (std::string* uid : {&uids.plan, &uids.plan_series, &uids.structures, &uids.structures_series, &uids.image_series,
                           &uids.image_frame})
    *uid = next();
  uids.images = {next(), next()};
  return uids;
}

constexpr const char* kManufacturer = "isoshift campaign";

std::string label_of(const CasePlan& plan, std::size_t view) {
  const Exposure& exposure = plan.exposures[view];
  return fmt::format("{}{}_G{:.1f}", exposure.is_megavoltage ? "MV" : "KV", view + 1, exposure.gantry_deg);
}

void write_plan(const CasePlan& plan, const Patient& patient, const CaseUids& uids, const std::filesystem::path& path) {
  DicomFile file;
  DicomItem dataset = file.dataset();
  put_common(dataset, patient.identity,
             {UID_RTPlanStorage, uids.plan, "RTPLAN", uids.plan_series, patient.frame_of_reference_uid}, kManufacturer);
  dataset.put(DCM_RTPlanLabel, "SETUP");
  dataset.put(DCM_RTPlanDate, "20260228");
  dataset.put(DCM_RTPlanTime, "090000");
  dataset.put(DCM_RTPlanGeometry, "PATIENT");
  dataset.append_reference(DCM_ReferencedStructureSetSequence, UID_RTStructureSetStorage, uids.structures);
  dataset.put(DCM_ApprovalStatus, "UNAPPROVED");
  put_target_reference(dataset);
  DicomItem group = dataset.append_item(DCM_FractionGroupSequence);
  group.put(DCM_FractionGroupNumber, 1);
  group.put(DCM_NumberOfFractionsPlanned, 1);
  group.put(DCM_NumberOfBeams, 2);
  group.put(DCM_NumberOfBrachyApplicationSetups, 0);
  for (std::size_t view = 0; view < 2; ++view) {
    group.append_item(DCM_ReferencedBeamSequence).put(DCM_ReferencedBeamNumber, static_cast<int>(view) + 1);
    put_setup_beam(dataset.append_item(DCM_BeamSequence), {.machine = "CAMPAIGN",
                                                           .sad_mm = kSadMm,
                                                           .number = static_cast<int>(view) + 1,
                                                           .name = label_of(plan, view),
                                                           .gantry_deg = plan.exposures[view].gantry_deg,
                                                           .couch_deg = 0.0,
                                                           .isocenter_patient_mm = plan.setup.isocenter_patient_mm});
  }
  DicomItem setup = dataset.append_item(DCM_PatientSetupSequence);
  setup.put(DCM_PatientSetupNumber, 1);
  setup.put(DCM_PatientPosition, patient.position);
  file.write(path);
}

void write_xray(const CasePlan& plan, const Patient& patient, const CaseUids& uids, std::size_t view,
                const std::vector<float>& intensity, const std::filesystem::path& path) {
  constexpr float kStoredAtOpen = 60000.0F;
  std::vector<std::uint16_t> stored(intensity.size());
  std::ranges::transform(intensity, stored.begin(), [](float value) {
    return static_cast<std::uint16_t>(std::clamp(std::lround(kStoredAtOpen * value), 0L, 65535L));
  });
  const bool is_mv = plan.exposures[view].is_megavoltage;
  DicomFile file;
  DicomItem dataset = file.dataset();
  put_common(dataset, patient.identity,
             {UID_RTImageStorage, uids.images[view], "RTIMAGE", uids.image_series, uids.image_frame}, kManufacturer);
  constexpr double kCornerMm = 0.5 * (kPixels - 1) * kPixelMm;
  dataset.put(DCM_ImageType, is_mv ? "ORIGINAL\\PRIMARY\\PORTAL" : "ORIGINAL\\PRIMARY\\RADIOGRAPH");
  dataset.put(DCM_ConversionType, "DI");
  const std::string time = fmt::format("1015{:02}", 10 * view);
  for (const DcmTagKey& tag : {DCM_ContentDate, DCM_AcquisitionDate}) dataset.put(tag, "20260301");
  for (const DcmTagKey& tag : {DCM_ContentTime, DCM_AcquisitionTime}) dataset.put(tag, time);
  dataset.put(DCM_PatientPosition, patient.position);
  dataset.put(DCM_InstanceNumber, fmt::format("{}", view + 1));
  dataset.put(DCM_RTImageLabel, label_of(plan, view));
  dataset.put(DCM_ReportedValuesOrigin, "ACTUAL");
  dataset.put(DCM_RTImagePlane, "NORMAL");
  dataset.put(DCM_XRayImageReceptorTranslation, std::array{0.0, 0.0, kSadMm - kSidMm});
  dataset.put(DCM_XRayImageReceptorAngle, 0.0);
  dataset.put(DCM_RTImageOrientation, "1\\0\\0\\0\\-1\\0");
  dataset.put(DCM_ImagePlanePixelSpacing, std::array{kPixelMm, kPixelMm});
  dataset.put(DCM_RTImagePosition, std::array{-kCornerMm, kCornerMm});
  dataset.put(DCM_RadiationMachineName, "CAMPAIGN");
  dataset.put(DCM_PrimaryDosimeterUnit, "MU");
  dataset.put(DCM_RadiationMachineSAD, kSadMm);
  dataset.put(DCM_RTImageSID, kSidMm);
  dataset.put(DCM_GantryAngle, plan.exposures[view].gantry_deg);
  for (const DcmTagKey& angle :
       {DCM_BeamLimitingDeviceAngle, DCM_PatientSupportAngle, DCM_TableTopPitchAngle, DCM_TableTopRollAngle})
    dataset.put(angle, 0.0);
  dataset.append_item(DCM_ExposureSequence).put(DCM_KVP, is_mv ? 6000.0 : 120.0);
  dataset.append_reference(DCM_ReferencedRTPlanSequence, UID_RTPlanStorage, uids.plan);
  dataset.put(DCM_ReferencedBeamNumber, fmt::format("{}", view + 1));
  put_pixel_format(dataset, {.columns = kPixels, .rows = kPixels});
  dataset.put(DCM_PixelIntensityRelationship, "LIN");
  dataset.put(DCM_PixelIntensityRelationshipSign, 1);
  dataset.put(DCM_RescaleIntercept, 0.0);
  dataset.put(DCM_RescaleSlope, 1.0);
  dataset.put(DCM_RescaleType, "US");
  dataset.put_pixels(stored);
  file.write(path);
}

// A ball about the isocenter, a circle per slice of the CT.
void write_structures(const CasePlan& plan, const Patient& patient, const CaseUids& uids,
                      const std::filesystem::path& path) {
  DicomFile file;
  DicomItem dataset = file.dataset();
  put_common(
      dataset, patient.identity,
      {UID_RTStructureSetStorage, uids.structures, "RTSTRUCT", uids.structures_series, patient.frame_of_reference_uid},
      kManufacturer);
  dataset.put(DCM_StructureSetLabel, "TARGET");
  dataset.put(DCM_StructureSetDate, "20260228");
  dataset.put(DCM_StructureSetTime, "090000");
  dataset.append_item(DCM_ReferencedFrameOfReferenceSequence)
      .put(DCM_FrameOfReferenceUID, patient.frame_of_reference_uid);
  std::vector<double> slices_mm;
  for (int k = 0; k < patient.size.z(); ++k) slices_mm.push_back(patient.place_mm(0, 0, k).z());
  put_ball_target(dataset,
                  {.name = "PTV",
                   .interpreted_type = "PTV",
                   .center_patient_mm = plan.setup.isocenter_patient_mm,
                   .radius_mm = plan.target_radius_mm,
                   .contour_points = 48},
                  patient.frame_of_reference_uid, slices_mm, plan.target_radius_mm - 0.5);
  dataset.put(DCM_ApprovalStatus, "UNAPPROVED");
  file.write(path);
}

Json list(const Vector3d& v) { return {v.x(), v.y(), v.z()}; }

// Where the anatomy about a point of the CT is found in the room: planned x at R x + t.
Json motion_at(const CasePlan& plan, const Patient& patient, const Deformation& deformation, const Vector3d& at_mm) {
  const Eigen::Isometry3d deformed = deformation.motion_near(at_mm);
  const Matrix3d axes = room_axes(patient.position);
  const Vector3d& isocenter = plan.setup.isocenter_patient_mm;
  const Matrix3d rotation = plan.setup.rotation * axes * deformed.linear() * axes.transpose();
  const Vector3d translation =
      plan.setup.rotation * (axes * (deformed * isocenter - isocenter)) + plan.setup.translation_mm;
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row) rows.push_back({rotation(row, 0), rotation(row, 1), rotation(row, 2)});
  return {{"center_patient_mm", list(at_mm)}, {"rotation_matrix", rows}, {"translation_mm", list(translation)}};
}

void write_truth(const CasePlan& plan, const Patient& patient, const Deformation& deformation,
                 const std::filesystem::path& path) {
  const Vector3d& isocenter = plan.setup.isocenter_patient_mm;
  Json truth = {
      {"seed", plan.seed},
      {"stratum", plan.stratum},
      {"anatomy", plan.anatomy},
      {"disturbances", plan.disturbances},
      {"isocenter_patient_mm", list(isocenter)},
      {"patient_position", patient.position},
      {"couch_deg", 0},
      {"target", {{"name", "PTV"}, {"center_patient_mm", list(isocenter)}, {"radius_mm", plan.target_radius_mm}}}};
  truth["setup_error_room"] = motion_at(plan, patient, deformation, isocenter);
  truth["setup_error_room"]["means"] =
      "of the anatomy at the target's center (PTV): planned at x (IEC 61217 fixed, mm from the isocenter), found at "
      "R x + t";
  for (int level = -3; level <= 3; ++level) {
    Vector3d at = isocenter + Vector3d(0.0, 0.0, 30.0 * level);
    if (plan.anatomy == "chest") at = chest_spine_mm(at.z());
    if (at.z() < patient.first_mm.z() || at.z() > patient.place_mm(0, 0, patient.size.z() - 1).z()) continue;
    truth["levels"].push_back(motion_at(plan, patient, deformation, at));
  }
  truth["levels_mean"] = "the same for the anatomy about these points of the planning CT";
  std::ofstream(path) << truth.dump(1) << "\n";
}

}  // namespace

void write_case(const CasePlan& plan, const Patient& patient, const Deformation& deformation,
                const std::vector<std::vector<float>>& images, const std::filesystem::path& folder) {
  const CaseUids uids = make_uids(plan);
  std::filesystem::create_directories(folder / "RTIMAGE");
  write_plan(plan, patient, uids, folder / "RTPLAN.dcm");
  write_structures(plan, patient, uids, folder / "RTSTRUCT.dcm");
  for (std::size_t view = 0; view < images.size(); ++view)
    write_xray(plan, patient, uids, view, images[view], folder / "RTIMAGE" / (label_of(plan, view) + ".dcm"));
  write_truth(plan, patient, deformation, folder / "truth.json");
}

}  // namespace isoshift::campaign
