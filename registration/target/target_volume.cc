#include "registration/target/target_volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "drr/attenuation.h"
#include "geometry/mask.h"

namespace isoshift {
namespace {

constexpr double kSurroundingsMm = 30.0;
constexpr double kNearEndMm = 25.0;

// The six neighbors of a cube's center, its edges and its corners.
std::vector<Eigen::Vector3d> directions_all_around() {
  std::vector<Eigen::Vector3d> directions;
  for (int n = 0; n < 27; ++n) {
    const Eigen::Vector3i step(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1);
    if (!step.isZero()) directions.push_back(step.cast<double>().normalized());
  }
  return directions;
}

}  // namespace

Target isocenter_surroundings() {
  Target target{.name = fmt::format("{}, {:.0f} mm", kIsocenterSurroundings, kSurroundingsMm)};
  for (const Eigen::Vector3d& direction : directions_all_around())
    target.extent_room_mm.push_back(kSurroundingsMm * direction);
  return target;
}

Target target_in(const Volume<std::uint8_t>& mask, const Eigen::Isometry3d& planned_room_from_patient) {
  Target target{.center_room_mm = planned_room_from_patient * centroid_patient_mm(mask)};
  const Eigen::Affine3d room_from_voxel = planned_room_from_patient * mask.patient_from_voxel;
  const std::vector<Eigen::Vector3d> directions = directions_all_around();
  target.extent_room_mm.assign(directions.size(), target.center_room_mm);
  for (int k = 0; k < mask.size.z(); ++k)
    for (int j = 0; j < mask.size.y(); ++j)
      for (int i = 0; i < mask.size.x(); ++i) {
        if (mask.at(i, j, k) == 0) continue;
        const Eigen::Vector3d at = room_from_voxel * Eigen::Vector3d(i, j, k);
        for (std::size_t n = 0; n < directions.size(); ++n)
          if (directions[n].dot(at) > directions[n].dot(target.extent_room_mm[n])) target.extent_room_mm[n] = at;
      }
  return target;
}

std::optional<double> end_of_ct_near_mm(const Volume<float>& ct_hu, const Eigen::Vector3d& point_patient_mm) {
  const Eigen::Vector3d at = ct_hu.patient_from_voxel.inverse() * point_patient_mm, spacing = ct_hu.spacing_mm();
  const auto threshold_hu = static_cast<float>(AttenuationModel().threshold_hu);
  std::optional<double> nearest_mm;
  for (int axis = 0; axis < 3; ++axis)
    for (const int end : {0, ct_hu.size[axis] - 1}) {
      const double away_mm = (end == 0 ? at[axis] : end - at[axis]) * spacing[axis];
      if (away_mm > nearest_mm.value_or(kNearEndMm)) continue;
      const int u = (axis + 1) % 3, v = (axis + 2) % 3;
      bool goes_on = false;
      Eigen::Vector3i voxel;
      voxel[axis] = end;
      for (voxel[u] = 0; voxel[u] < ct_hu.size[u] && !goes_on; ++voxel[u])
        for (voxel[v] = 0; voxel[v] < ct_hu.size[v] && !goes_on; ++voxel[v])
          goes_on = std::hypot((voxel[u] - at[u]) * spacing[u], (voxel[v] - at[v]) * spacing[v]) <= kNearEndMm &&
                    ct_hu.at(voxel.x(), voxel.y(), voxel.z()) > threshold_hu;
      if (goes_on) nearest_mm = std::max(0.0, away_mm);
    }
  return nearest_mm;
}

}  // namespace isoshift
