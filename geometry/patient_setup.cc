#include "geometry/patient_setup.h"

#include <utility>

namespace isoshift {
namespace {

constexpr std::array<std::pair<PatientPosition, std::string_view>, 8> kDefinedTerms = {{
    {PatientPosition::kHfs, "HFS"},
    {PatientPosition::kHfp, "HFP"},
    {PatientPosition::kFfs, "FFS"},
    {PatientPosition::kFfp, "FFP"},
    {PatientPosition::kHfdr, "HFDR"},
    {PatientPosition::kHfdl, "HFDL"},
    {PatientPosition::kFfdr, "FFDR"},
    {PatientPosition::kFfdl, "FFDL"},
}};

}  // namespace

std::string_view to_string(PatientPosition position) {
  for (const auto& [value, term] : kDefinedTerms)
    if (value == position) return term;
  return "";
}

std::optional<PatientPosition> patient_position_from(std::string_view defined_term) {
  for (const auto& [value, term] : kDefinedTerms)
    if (term == defined_term) return value;
  return std::nullopt;
}

Eigen::Matrix3d table_from_patient_axes(PatientPosition position) {
  const Eigen::RowVector3d left = Eigen::RowVector3d::UnitX();
  const Eigen::RowVector3d posterior = Eigen::RowVector3d::UnitY();
  const Eigen::RowVector3d superior = Eigen::RowVector3d::UnitZ();
  Eigen::Matrix3d axes;
  switch (position) {  // table x (viewer's right), y (toward the gantry), z (up)
    case PatientPosition::kHfs: axes << left, superior, -posterior; break;
    case PatientPosition::kHfp: axes << -left, superior, posterior; break;
    case PatientPosition::kFfs: axes << -left, -superior, -posterior; break;
    case PatientPosition::kFfp: axes << left, -superior, posterior; break;
    case PatientPosition::kHfdr: axes << posterior, superior, left; break;
    case PatientPosition::kHfdl: axes << -posterior, superior, -left; break;
    case PatientPosition::kFfdr: axes << -posterior, -superior, left; break;
    case PatientPosition::kFfdl: axes << posterior, -superior, -left; break;
  }
  return axes;
}

Eigen::Isometry3d planned_room_from_patient(PatientPosition position, const TableAngles& table,
                                            const Eigen::Vector3d& isocenter_patient_mm) {
  Eigen::Isometry3d room_from_patient = Eigen::Isometry3d::Identity();
  room_from_patient.linear() = rotation_from_zxy(table.zxy()) * table_from_patient_axes(position);
  room_from_patient.translation() = -(room_from_patient.linear() * isocenter_patient_mm);
  return room_from_patient;
}

}  // namespace isoshift
