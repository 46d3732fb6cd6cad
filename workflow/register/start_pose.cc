#include "workflow/register/start_pose.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/json_file.h"
#include "workflow/register/setup_error_json.h"

namespace isoshift {
namespace {

using Json = nlohmann::json;

// As results round it.
constexpr double kSameIsocenterMm = 0.01;

void require_same_patient(const Json& json, const Identity& patient, const std::string& file) {
  if (!json.contains("patient")) return;  // a truth, or a pose set by hand
  const std::string id = json.at("patient").at("id");
  if (id != patient.patient_id)
    throw Error(fmt::format("{}: is of the patient \"{}\", and the CT of \"{}\": a start must be of the same patient",
                            file, id, patient.patient_id));
}

void require_same_isocenter(const Json& json, const Eigen::Vector3d& isocenter_patient_mm, const std::string& file) {
  if (!json.contains("isocenter_patient_mm")) return;
  const auto mm = json.at("isocenter_patient_mm").get<std::array<double, 3>>();
  if ((Eigen::Vector3d(mm.data()) - isocenter_patient_mm).norm() > kSameIsocenterMm)
    throw Error(
        fmt::format("{}: its isocenter is ({:.2f}), and that of the study ({:.2f}): a setup error is about the "
                    "isocenter, so that a start must have the same one",
                    file, fmt::join(mm, ", "), fmt::join(isocenter_patient_mm, ", ")));
}

}  // namespace

Start read_start(const std::filesystem::path& file, const Study& study) {
  const std::string name = file.string();
  const JsonFile read = read_json_file(file);
  const Json& json = read.json;
  const Eigen::Isometry3d setup_error = setup_error_in(json, name);
  try {
    require_same_patient(json, study.ct->identity, name);
    require_same_isocenter(json, study.isocenter_patient_mm, name);
    return {.setup_error = setup_error,
            .file = file.filename().string(),
            .sha256 = read.sha256,
            .set_by = json.value("set_by", "")};
  } catch (const Json::exception& error) {
    throw Error(fmt::format("{}: is no result.json, truth.json or pose set by hand: {}", name, error.what()));
  }
}

}  // namespace isoshift
