#include "registration/target/surrogate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <span>
#include <utility>
#include <vector>

#include "base/error.h"
#include "bodies/lattice.h"
#include "bodies/vertebrae.h"
#include "registration/bodies/carriers.h"
#include "registration/target/near_target.h"
#include "registration/target/region_check.h"

namespace isoshift {
namespace {

// Whether a CT shows bone near a place: as much as a small piece of rib, or a ball. Quicker than finding its bodies,
// which only bent patients need.
bool is_bone_near(const Volume<float>& ct_hu, const Eigen::Vector3d& patient_mm) {
  const double bone_hu = BodyOptions().bone_hu, voxel_mm3 = ct_hu.spacing_mm().prod();
  double found_mm3 = 0.0;
  for_voxels_near(ct_hu, patient_mm, [&](int i, int j, int k) {
    if (ct_hu.at(i, j, k) >= bone_hu) found_mm3 += voxel_mm3;
  });
  return found_mm3 >= kLeastBoneMm3;
}

bool holds_bone(const Volume<float>& ct_hu, const Volume<std::uint8_t>& structure) {
  double found_mm3 = 0.0;
  for (std::size_t n = 0; n < ct_hu.voxels.size(); ++n)
    if (structure.voxels[n] != 0 && ct_hu.voxels[n] >= BodyOptions().bone_hu) found_mm3 += ct_hu.spacing_mm().prod();
  return found_mm3 >= kLeastBoneMm3;
}

// Which bodies hang on the spine by bones that touch, without ribs between them, as a pelvis does. Ribs breathe, and a
// shoulder blade (thin bones beside the spine are "ribs") goes with the arm, and the arm's bones with it.
std::vector<bool> hanging_on_spine(const BodyMap& map) {
  std::vector<bool> hangs(map.bodies.size());
  for (std::size_t n = 0; n < map.bodies.size(); ++n) hangs[n] = map.bodies[n].kind == Body::Kind::kVertebra;
  const auto may_hang = [&](int body) { return map.bodies[static_cast<std::size_t>(body)].kind == Body::Kind::kBone; };
  for (bool is_new = true; is_new;) {
    is_new = false;
    for (const Joint& joint : map.joints)
      for (const auto& [from, to] : {std::pair(joint.a, joint.b), std::pair(joint.b, joint.a)}) {
        const auto other = static_cast<std::size_t>(to);
        if (!hangs[static_cast<std::size_t>(from)] || hangs[other] || !may_hang(to)) continue;
        hangs[other] = is_new = true;
      }
  }
  return hangs;
}

// The bodies that come within 20 mm of a point.
std::set<std::size_t> bodies_near(const BodyMap& map, const Eigen::Vector3d& point_patient_mm) {
  std::set<std::size_t> near;
  for_voxels_near(map.labels, point_patient_mm, [&](int i, int j, int k) {
    if (const int label = map.labels.at(i, j, k); label > 0) near.insert(static_cast<std::size_t>(label) - 1);
  });
  std::erase_if(near, [&](std::size_t body) { return map.bodies[body].kind == Body::Kind::kCouch; });
  return near;
}

bool is_vertebra_near(std::span<const Vertebra> vertebrae, const Eigen::Vector3d& point_patient_mm) {
  return std::ranges::any_of(vertebrae, [&](const Vertebra& vertebra) {
    return (point_patient_mm - vertebra.center_patient_mm).norm() <= vertebra.radius_mm + kCarriersNearMm;
  });
}

// How many points have a bone near them that hangs on the spine, how many have other bones only, and how many have
// something dense that was not recognized as a bone.
struct PointsByBone {
  int of_spine = 0, of_others = 0, unrecognized = 0;

  bool are_carried() const { return of_spine >= of_others + unrecognized; }
};

PointsByBone points_by_bone(const Volume<float>& ct_hu, const BodyMap& map,
                            std::span<const Eigen::Vector3d> points_patient_mm) {
  const std::vector<bool> hangs = hanging_on_spine(map);
  PointsByBone count;
  for (const Eigen::Vector3d& point : points_patient_mm) {
    const std::set<std::size_t> near = bodies_near(map, point);
    if (std::ranges::any_of(near, [&](std::size_t body) { return hangs[body]; }))
      ++count.of_spine;
    else if (!near.empty())
      ++count.of_others;
    else if (is_bone_near(ct_hu, point))
      ++count.unrecognized;
  }
  return count;
}

// The vertebrae that a CT shows, from the feet to the head, and whether it is of a trunk.
struct Spine {
  std::vector<Vertebra> vertebrae;
  bool is_of_trunk = false;
};

Spine spine_of(const Volume<float>& ct_hu) {
  const Volume<float> on_axes = on_patient_axes(ct_hu, BodyOptions().lattice_mm);
  Spine spine{.vertebrae = find_vertebrae(ct_hu, on_axes)};
  spine.is_of_trunk = is_trunk(spine.vertebrae, on_axes);
  return spine;
}

// Why a target at a vertebra, or behind it, may have moved unnoticed: below a head the CT shows less than four of them,
// and next to nothing tells how such a neck has bent. Targets 20 to 45 mm before and behind C2 were accepted 2 to 5 mm
// off. A jaw lies farther to the front.
std::optional<std::string> doubt_of_neck(const PlannedPatient& patient, const Spine& spine, const Target& target) {
  const Eigen::Vector3d at_patient_mm = points_patient_mm(patient, target).front();
  if (spine.vertebrae.empty() || spine.is_of_trunk ||
      at_patient_mm.z() > spine.vertebrae.back().upper.center_patient_mm.z())
    return {};
  const Vertebra& level = level_of(at_patient_mm, spine.vertebrae);
  const Eigen::Vector3d from_center = at_patient_mm - level.center_patient_mm;
  const double near_mm = level.radius_mm + kCarriersNearMm;
  if (std::abs(from_center.x()) > near_mm || from_center.y() < -near_mm) return {};
  return fmt::format(
      "the target lies at the neck, of which the CT shows {} vertebrae: too few to tell whether it has bent under the "
      "head",
      spine.vertebrae.size());
}

struct NearTarget {
  std::string what = "bone";
  std::optional<std::string> doubt;  // why it may not carry the target as the whole patient moves
};

// The dense places near a target. What is near its center counts, and where nothing is, what most of its surface is
// near to. Doubted only in a trunk: in a head bones hang together. Vertebrae are asked first, because they are found
// quickly and are what most targets lie near.
NearTarget bones_near(const PlannedPatient& patient, const Spine& spine, const Target& target, BodyStore& bodies) {
  const Volume<float>& ct_hu = *patient.ct_hu;
  const std::vector<Eigen::Vector3d> points = points_patient_mm(patient, target);
  if (!spine.is_of_trunk || is_vertebra_near(spine.vertebrae, points.front())) return {};
  const BodyMap& map = *bodies.map(patient.ct_hu);
  PointsByBone near = points_by_bone(ct_hu, map, std::span(points).first(1));
  if (near.of_spine + near.of_others == 0) near = points_by_bone(ct_hu, map, points);
  if (near.are_carried()) return {};
  if (near.of_others < near.unrecognized)
    return {.what = "dense places, not recognized as bone,",
            .doubt = fmt::format(
                "what is dense within {:.0f} mm of the target was not recognized as a bone that could carry it "
                "(it may be contrast agent, calcification or a thin bone), and the site file names no surrogate",
                kCarriersNearMm)};
  return {.doubt = fmt::format(
              "hardly more than ribs, bones of the shoulders or other bones that do not hang on the spine lies within "
              "{:.0f} mm of the target: they move by themselves, and the site file names no surrogate",
              kCarriersNearMm)};
}

}  // namespace

std::vector<Eigen::Vector3d> points_patient_mm(const PlannedPatient& patient, const Target& target) {
  const Eigen::Isometry3d patient_from_room = patient.room_from_patient.inverse();
  std::vector<Eigen::Vector3d> points = {patient_from_room * target.center_room_mm};
  for (const Eigen::Vector3d& point : target.extent_room_mm) points.push_back(patient_from_room * point);
  return points;
}

Surrogate surrogate_in(const PlannedPatient& patient, const Target& target, ChosenVolume drawn) {
  const std::string name = drawn.words;
  drawn.words = "surrogate " + name;
  if (!holds_bone(*patient.ct_hu, drawn.mask))
    throw Error(fmt::format("{}: the CT shows no bone in this structure", drawn.words));
  std::optional<std::string> doubt = volume_doubt(patient, drawn);
  if (!doubt) doubt = doubt_of_neck(patient, spine_of(*patient.ct_hu), target);
  return {.words = "bones in " + name, .drawn = std::move(drawn.mask), .doubt = std::move(doubt)};
}

Surrogate surrogate_near(const PlannedPatient& patient, const Target& target, BodyStore& bodies) {
  const auto is_near_bone = [&](const Eigen::Vector3d& point) { return is_bone_near(*patient.ct_hu, point); };
  if (!std::ranges::any_of(points_patient_mm(patient, target), is_near_bone))
    return {.words = "none",
            .drawn = {},
            .doubt = fmt::format("no bone lies within {:.0f} mm of the target, and the site file names no surrogate: "
                                 "X-rays do not show soft tissue",
                                 kCarriersNearMm)};
  const Spine spine = spine_of(*patient.ct_hu);
  NearTarget near{.doubt = doubt_of_neck(patient, spine, target)};
  if (!near.doubt) near = bones_near(patient, spine, target, bodies);
  return {.words = fmt::format("{} within {:.0f} mm", near.what, kCarriersNearMm),
          .drawn = {},
          .doubt = std::move(near.doubt)};
}

}  // namespace isoshift
