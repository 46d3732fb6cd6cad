#include "workflow/register/start_pose.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/error.h"
#include "base/json_file.h"
#include "base/option_name.h"
#include "base/sha256.h"
#include "geometry/rotation.h"
#include "io/objects/itk_transform.h"
#include "io/objects/registration_check.h"
#include "io/objects/registration_meaning.h"
#include "io/study/session.h"
#include "workflow/register/same_setup.h"
#include "workflow/register/setup_error_json.h"

namespace isoshift {
namespace {

// In the frame of the study's X-rays, where that is the object's source frame.
std::optional<Eigen::Vector3d> isocenter_of_xrays(const Study& study, const std::string& frame_uid) {
  for (const RtImage& image : study.rt_images)
    if (image.frame_of_reference_uid == frame_uid && image.isocenter_mm) return image.isocenter_mm;
  return std::nullopt;
}

// A transform in ITK's format takes the frame of its fixed image, in which the patient lies as he does, to the CT.
CheckedRegistration object_of_transform(const std::filesystem::path& file, const Study& study) {
  CheckedRegistration object;
  object.path = file;
  object.source_frame_uid = "of the fixed image";  // not named in the file
  object.identity = study.ct->identity;
  object.registered_frame_uid = study.ct->frame_of_reference_uid;
  object.registered_from_source = read_itk_transform(file);
  return object;
}

Start start_of_object(CheckedRegistration object, const Study& study,
                      std::optional<Eigen::Vector3d> source_isocenter_mm, Notes& notes) {
  const std::filesystem::path file = object.path;
  const std::string name = file.string();
  const auto different_patients = patient_findings({&study.ct->identity, "the CT"}, {&object.identity, name});
  if (!different_patients.empty()) throw Error(different_patients.front().message);
  if (object.registered_frame_uid != study.ct->frame_of_reference_uid)
    throw Error(fmt::format("{}: registers the frame {}, and the CT has {} ({}): a start must be of the same CT", name,
                            object.registered_frame_uid, study.ct->frame_of_reference_uid,
                            described(DCM_FrameOfReferenceUID)));
  const std::optional<Eigen::Vector3d> of_xrays_mm = isocenter_of_xrays(study, object.source_frame_uid);
  if (source_isocenter_mm && of_xrays_mm && (*source_isocenter_mm - *of_xrays_mm).norm() > kSameIsocenterMm)
    throw UsageError(
        fmt::format("{} contradicts the X-rays, whose {} in the same frame is ({}) mm: leave the switch out",
                    option("source-isocenter", fmt::format("{}", fmt::join(*source_isocenter_mm, ","))),
                    described(DCM_IsocenterPosition), fmt::join(*of_xrays_mm, ", ")));
  const std::string says_where =
      source_isocenter_mm ? option("source-isocenter") : described(DCM_IsocenterPosition) + " of the X-rays";
  if (!source_isocenter_mm) source_isocenter_mm = of_xrays_mm;
  const PlannedSetup setup{.plan = std::nullopt,
                           .patient_position = study.patient_position,
                           .isocenter_patient_mm = study.isocenter_patient_mm,
                           .couch_angle_deg = deg_from_rad(study.table.yaw_rad()),
                           .couch_pitch_deg = deg_from_rad(study.table.pitch_rad),
                           .couch_roll_deg = deg_from_rad(study.table.roll_rad)};
  const RegistrationMeaning meaning = meaning_of(object, setup, source_isocenter_mm, says_where);
  for (const RegistrationFinding& finding : object.findings) {
    if (finding.is_error && !meaning.setup_error) throw Error(fmt::format("{}: {}", name, finding.text));
    notes.warnings.push_back(fmt::format("{}: {}", file.filename().string(), finding.text));
  }
  return {.setup_error = meaning.setup_error.value(),
          .file = file.filename().string(),
          .sha256 = sha256_of_file(file),
          .set_by = ""};
}

}  // namespace

Start read_start(const std::filesystem::path& file, const Study& study, std::span<const double> source_isocenter_mm,
                 Notes& notes) {
  std::optional<Eigen::Vector3d> isocenter_mm;
  if (!source_isocenter_mm.empty()) isocenter_mm = Eigen::Vector3d(source_isocenter_mm.data());
  if (beginning_of(file) == Beginning::kDicom) {
    const CheckedRegistration object = check_registration(file);
    if (isocenter_mm) refuse_contradicting_isocenter({&object, 1}, *isocenter_mm);
    return start_of_object(object, study, isocenter_mm, notes);
  }
  if (is_itk_transform(file)) {
    if (!isocenter_mm)
      throw Error(
          fmt::format("{}: does not say where the machine's isocenter lies in the frame of its fixed image.\n"
                      "       Supply it: {}",
                      file.string(), option("source-isocenter", "X,Y,Z")));
    return start_of_object(object_of_transform(file, study), study, isocenter_mm, notes);
  }
  const std::string name = file.string();
  if (isocenter_mm)
    throw UsageError(
        fmt::format("{}: is no registration object or ITK transform, and has no source frame: leave {} out", name,
                    option("source-isocenter")));
  const JsonFile read = read_json_file(file);
  const nlohmann::json& json = read.json;
  const Eigen::Isometry3d setup_error = setup_error_in(json, name);
  try {
    require_same_setup(json, name, study);
    return {.setup_error = setup_error,
            .file = file.filename().string(),
            .sha256 = read.sha256,
            .set_by = json.value("set_by", "")};
  } catch (const nlohmann::json::exception& error) {
    throw Error(fmt::format("{}: is no result.json, truth.json or pose set by hand: {}", name, reason_of(error)));
  }
}

}  // namespace isoshift
