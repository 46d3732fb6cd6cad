#include "workflow/register/same_setup.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <cmath>

#include "base/error.h"
#include "base/json_file.h"
#include "geometry/rotation.h"
#include "io/dicom/table_read_outs.h"

namespace isoshift {
namespace {

constexpr double kRoundedIsocenterMm = 0.01;  // as results round it
constexpr const char* kWhy = "a setup error is about the planned pose, so that both must have the same one";

void require_same_angle(double found_deg, double expected_rad, const char* angle, const std::string& name) {
  if (std::abs(wrapped_rad(rad_from_deg(found_deg) - expected_rad)) > rad_from_deg(kMaxTableTurnDeg))
    throw Error(fmt::format("{}: its couch {} is {:.1f} degrees, and that of the study {:.1f}: {}", name, angle,
                            found_deg, deg_from_rad(expected_rad), kWhy));
}

void require_same_table(const nlohmann::json& file, const std::string& name, const TableAngles& expected) {
  if (file.contains("couch_deg")) require_same_angle(file.at("couch_deg"), expected.yaw_rad(), "angle", name);
  if (!file.contains("table")) return;
  const nlohmann::json& table = file.at("table");
  require_same_angle(table.at("support_deg").get<double>() + table.at("eccentric_deg").get<double>(),
                     expected.yaw_rad(), "angle", name);
  require_same_angle(table.at("pitch_deg"), expected.pitch_rad, "pitch", name);
  require_same_angle(table.at("roll_deg"), expected.roll_rad, "roll", name);
}

}  // namespace

void require_same_setup(const nlohmann::json& file, const std::string& name, const Study& study) {
  const std::string position(to_string(study.patient_position));
  try {
    if (file.contains("patient") && file.at("patient").at("id") != study.ct->identity.patient_id)
      throw Error(fmt::format("{}: is of another patient than the study (PatientID)", name));
    if (const nlohmann::json frame =
            file.value("references", nlohmann::json::object()).value("ct_frame_of_reference", nlohmann::json());
        !frame.is_null() && frame != study.ct->frame_of_reference_uid)
      throw Error(fmt::format("{}: is about a CT in another frame of reference than the study's ({})", name,
                              described(DCM_FrameOfReferenceUID)));
    if (file.contains("patient_position") && file.at("patient_position") != position)
      throw Error(fmt::format("{}: its patient position is {}, and that of the study {}: {}", name,
                              file.at("patient_position").get<std::string>(), position, kWhy));
    if (file.contains("isocenter_patient_mm")) {
      const auto mm = file.at("isocenter_patient_mm").get<std::array<double, 3>>();
      if ((Eigen::Vector3d(mm.data()) - study.isocenter_patient_mm).norm() > kRoundedIsocenterMm)
        throw Error(fmt::format("{}: its isocenter is ({:.2f}), and that of the study ({:.2f}): {}", name,
                                fmt::join(mm, ", "), fmt::join(study.isocenter_patient_mm, ", "), kWhy));
    }
    require_same_table(file, name, study.table);
  } catch (const nlohmann::json::exception& error) {
    throw Error(fmt::format("{}: is no result.json, truth.json or pose set by hand: {}", name, reason_of(error)));
  }
}

}  // namespace isoshift
