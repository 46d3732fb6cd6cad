#include "registration/bodies/patient_bodies.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "drr/interpolation.h"
#include "geometry/rotation.h"

namespace isoshift {
namespace {

using Eigen::Vector3d;

constexpr double kBoneSlabMm = 60.0, kSoftSlabMm = 80.0;
constexpr double kFrontMm = 60.0;  // before the nearest vertebra
// Behind the nearest vertebra and at its height, in the middle: its spinous process.
constexpr double kBehindMm = 70.0, kMiddleMm = 20.0, kSameHeightMm = 20.0;
constexpr double kBoneHoldsMm = 15.0, kSoftIsMm = 30.0;  // soft tissue this near moves with the bone, this far does not
constexpr double kNeighborsMm = 100.0;                   // between centers of groups that springs join

// One sigma of what bodies move and turn against each other.
struct Stiffness {
  double mm, deg;
};
constexpr Stiffness kVertebrae = {0.7, 1.5}, kStiffJoint = {0.5, 1.5}, kJoint = {2.0, 4.0};
constexpr Stiffness kToSpine = {2.0, 3.0}, kBreathingToSpine = {6.0, 3.0}, kSoftToSpine = {10.0, 5.0};
constexpr Stiffness kGroups = {3.0, 3.0}, kLoose = {4.0, 5.0};

struct Group {
  JointedBodies::Body body;
  std::string side;
  std::vector<int> members;  // of the map's bodies
  Vector3d center_patient_mm = Vector3d::Zero();
  double volume_mm3 = 0.0;

  void add(const Vector3d& center, double volume) {
    center_patient_mm = (volume_mm3 * center_patient_mm + volume * center) / (volume_mm3 + volume);
    volume_mm3 += volume;
  }
};

int slab_of(double z_mm, double slab_mm) { return static_cast<int>(std::floor(z_mm / slab_mm + 0.5)); }

std::string name_of_group(const std::string& what, int slab, double slab_mm) {
  return slab == 0
             ? fmt::format("{} beside the target", what)
             : fmt::format("{} {:.0f} mm toward the {}", what, std::abs(slab) * slab_mm, slab > 0 ? "head" : "feet");
}

const Group* nearest(const std::vector<Group>& groups, const Vector3d& place, const auto& counts) {
  const Group* best = nullptr;
  for (const Group& group : groups)
    if (counts(group) && (!best || (group.center_patient_mm - place).norm() < (best->center_patient_mm - place).norm()))
      best = &group;
  return best;
}
bool is_vertebra(const Group& group) { return group.body.is_vertebra; }

// Vertebrae, from the feet to the head, named by how many of them lie between them and the one next to the target.
std::vector<Group> vertebrae_of(const BodyMap& map, const Vector3d& target) {
  std::vector<Group> groups;
  for (int n = 0; n < static_cast<int>(map.bodies.size()); ++n) {
    const Body& body = map.bodies[static_cast<std::size_t>(n)];
    if (body.kind != Body::Kind::kVertebra) continue;
    Group& group = groups.emplace_back();
    group.body.is_vertebra = true;
    group.members = {n};
    group.add(body.center_patient_mm, body.volume_mm3);
  }
  const Group* at_target = nearest(groups, target, is_vertebra);
  for (Group& group : groups) {
    const auto steps = &group - at_target;
    group.body.vertebra = static_cast<int>(steps);
    group.body.name = steps == 0
                          ? "vertebra nearest to the target"
                          : fmt::format("vertebra {} toward the {}", std::abs(steps), steps > 0 ? "head" : "feet");
  }
  return groups;
}

// By where it lies from the nearest vertebra. Where its arch is thin, a CT shows no bone between the two.
bool is_spinous_process(const Body& body, const Vector3d& from_vertebra) {
  return body.kind == Body::Kind::kBone && from_vertebra.y() > 0.0 && from_vertebra.y() < kBehindMm &&
         std::abs(from_vertebra.x()) < kMiddleMm && std::abs(from_vertebra.z()) < kSameHeightMm;
}

std::vector<Group> bones_of(const BodyMap& map, const Vector3d& target) {
  std::vector<Group> groups = vertebrae_of(map, target);
  const std::size_t vertebrae = groups.size();
  std::map<std::pair<std::string, int>, std::size_t> group_of;  // by side and slab
  for (int n = 0; n < static_cast<int>(map.bodies.size()); ++n) {
    const Body& body = map.bodies[static_cast<std::size_t>(n)];
    if (body.kind == Body::Kind::kCouch || body.kind == Body::Kind::kVertebra) continue;
    if (vertebrae == 0) {
      Group& group = groups.emplace_back();
      group.body.name = body.name.empty() ? fmt::format("bone {}", n + 1) : body.name;
      group.members = {n};
      group.add(body.center_patient_mm, body.volume_mm3);
      continue;
    }
    const Group& spine = *nearest(groups, body.center_patient_mm, is_vertebra);
    const Vector3d beside = body.center_patient_mm - spine.center_patient_mm;
    if (is_spinous_process(body, beside)) {
      groups[static_cast<std::size_t>(&spine - groups.data())].members.push_back(n);
      continue;
    }
    const std::string side = beside.y() < -kFrontMm ? "front" : beside.x() > 0.0 ? "left" : "right";
    const int slab = slab_of(body.center_patient_mm.z() - target.z(), kBoneSlabMm);
    const auto [at, is_new] = group_of.try_emplace({side, slab}, groups.size());
    if (is_new) groups.push_back({.body = {.name = name_of_group(side + " bones", slab, kBoneSlabMm)}, .side = side});
    Group& group = groups[at->second];
    group.members.push_back(n);
    group.add(body.center_patient_mm, body.volume_mm3);
    if (side == "front" && body.kind == Body::Kind::kRib) group.body.breathes = true;
  }
  return groups;
}

BodyShare share_of(const Group& group, const SoftMasks& masks) {
  BodyShare share(masks.size, masks.patient_from_voxel);
  for (const SoftMask& mask : masks.masks) {
    if (!std::ranges::count(group.members, mask.body)) continue;
    for (int k = 0; k < mask.weight.size.z(); ++k)
      for (int j = 0; j < mask.weight.size.y(); ++j)
        for (int i = 0; i < mask.weight.size.x(); ++i) {
          std::uint8_t& at = share.at(mask.first.x() + i, mask.first.y() + j, mask.first.z() + k);
          at = static_cast<std::uint8_t>(at + mask.weight.at(i, j, k));
        }
  }
  return share;
}

// Takes the soft tissue far from bone out of the shares of bones that do not breathe. From one slab to the next it
// changes over a quarter of a slab.
void add_soft_tissue(const SoftMasks& masks, const Vector3d& target, std::vector<Group>& groups,
                     std::vector<BodyShare>& shares) {
  const std::size_t bones = groups.size();
  std::map<std::pair<std::string, int>, std::size_t> group_of;
  const auto give = [&](const std::string& side, int slab, std::size_t voxel, const Vector3d& at, int part) {
    if (part == 0) return;
    const auto [entry, is_new] = group_of.try_emplace({side, slab}, groups.size());
    if (is_new) {
      groups.push_back({.body = {.name = name_of_group("soft tissue on the " + side, slab, kSoftSlabMm),
                                 .breathes = true,
                                 .is_soft = true},
                        .side = side});
      shares.emplace_back(masks.size, masks.patient_from_voxel);
    }
    std::uint8_t& share = shares[entry->second].voxels[voxel];
    share = static_cast<std::uint8_t>(share + part);
    groups[entry->second].add(at, part);
  };
  for (int k = 0; k < masks.size.z(); ++k)
    for (int j = 0; j < masks.size.y(); ++j)
      for (int i = 0; i < masks.size.x(); ++i) {
        const double far = (masks.to_bone_mm.at(i, j, k) - kBoneHoldsMm) / (kSoftIsMm - kBoneHoldsMm);
        if (far <= 0.0) continue;
        const std::size_t voxel = masks.to_bone_mm.index(i, j, k);
        const Vector3d at = masks.patient_from_voxel * Vector3d(i, j, k);
        int taken = 0;
        for (std::size_t bone = 0; bone < bones; ++bone) {
          if (groups[bone].body.breathes) continue;
          const int part = static_cast<int>(std::lround(std::min(1.0, far) * shares[bone].voxels[voxel]));
          shares[bone].voxels[voxel] = static_cast<std::uint8_t>(shares[bone].voxels[voxel] - part);
          taken += part;
        }
        const double along = (at.z() - target.z()) / kSoftSlabMm;
        const int slab = static_cast<int>(std::floor(along));
        const double to_next = std::clamp(4.0 * (along - slab - 0.5) + 0.5, 0.0, 1.0);
        const int next = static_cast<int>(std::lround(to_next * taken));
        const std::string side = at.x() > target.x() ? "left" : "right";
        give(side, slab, voxel, at, taken - next);
        give(side, slab + 1, voxel, at, next);
      }
}

class Springs {
 public:
  explicit Springs(const std::vector<Group>& groups) : groups_(groups) {}

  void add(const Group& a, const Group& b, const Vector3d& at, Stiffness stiffness) {
    springs_.push_back({.a = static_cast<std::size_t>(&a - groups_.data()),
                        .b = static_cast<std::size_t>(&b - groups_.data()),
                        .at_patient_mm = at,
                        .sigma_mm = stiffness.mm,
                        .sigma_rad = rad_from_deg(stiffness.deg)});
  }
  void add_between(const Group& a, const Group& b, Stiffness stiffness) {
    add(a, b, 0.5 * (a.center_patient_mm + b.center_patient_mm), stiffness);
  }
  std::vector<JointedBodies::Spring> take() { return std::move(springs_); }

 private:
  const std::vector<Group>& groups_;
  std::vector<JointedBodies::Spring> springs_;
};

void join_to_spine(const std::vector<Group>& groups, Springs& springs) {
  for (std::size_t n = 1; n < groups.size() && groups[n].body.is_vertebra; ++n)
    springs.add_between(groups[n - 1], groups[n], kVertebrae);
  for (const Group& group : groups) {
    if (group.body.is_vertebra) continue;
    const Group& spine = *nearest(groups, group.center_patient_mm, is_vertebra);
    if (group.body.breathes)
      springs.add(spine, group, group.center_patient_mm, group.body.is_soft ? kSoftToSpine : kBreathingToSpine);
    else
      springs.add_between(spine, group, kToSpine);
  }
}

// Without a spine: bones that touch, and every body with the bone next to it.
void join_bones(const std::vector<Group>& groups, const std::vector<Joint>& joints, Springs& springs) {
  for (const Joint& joint : joints) {
    const auto has = [](int member) {
      return [member](const Group& group) { return std::ranges::count(group.members, member) > 0; };
    };
    const auto a = std::ranges::find_if(groups, has(joint.a)), b = std::ranges::find_if(groups, has(joint.b));
    if (a != groups.end() && b != groups.end())
      springs.add(*a, *b, joint.at_patient_mm, joint.is_stiff ? kStiffJoint : kJoint);
  }
  for (const Group& group : groups) {
    const auto other_bone = [&](const Group& other) { return &other != &group && !other.body.is_soft; };
    if (const Group* bone = nearest(groups, group.center_patient_mm, other_bone))
      springs.add_between(*bone, group, group.body.is_soft ? kSoftToSpine : kLoose);
  }
}

std::vector<JointedBodies::Spring> springs_of(const std::vector<Group>& groups, const BodyMap& map) {
  Springs springs(groups);
  if (std::ranges::any_of(groups, is_vertebra))
    join_to_spine(groups, springs);
  else
    join_bones(groups, map.joints, springs);
  // Groups of one side, and all of the soft tissue, hang together.
  for (const Group& a : groups)
    for (const Group& b : groups)
      if (&a < &b && !a.side.empty() && !b.side.empty() && a.body.is_soft == b.body.is_soft &&
          (a.body.is_soft || a.side == b.side) && (a.center_patient_mm - b.center_patient_mm).norm() < kNeighborsMm)
        springs.add_between(a, b, kGroups);
  return springs.take();
}

}  // namespace

PatientBodies patient_bodies(const BodyMap& map, SoftMasks masks, const Vector3d& target_patient_mm) {
  PatientBodies patient;
  std::vector<Group> groups = bones_of(map, target_patient_mm);
  if (groups.empty()) return patient;
  for (const Group& group : groups) patient.carried.push_back(share_of(group, masks));
  patient.bodies.shares = patient.carried;
  add_soft_tissue(masks, target_patient_mm, groups, patient.bodies.shares);
  for (const Group& group : groups) patient.bodies.bodies.push_back(group.body);
  patient.bodies.springs = springs_of(groups, map);
  patient.to_bone_mm = std::move(masks.to_bone_mm);
  return patient;
}

std::vector<double> shares_of_bone_in(const PatientBodies& patient, const Volume<std::uint8_t>& structure) {
  std::vector<double> sums(patient.bodies.bodies.size());
  double all = 0.0;
  const Eigen::Affine3d structure_from_lattice =
      structure.patient_from_voxel.inverse() * patient.to_bone_mm.patient_from_voxel;
  for (int k = 0; k < patient.to_bone_mm.size.z(); ++k)
    for (int j = 0; j < patient.to_bone_mm.size.y(); ++j)
      for (int i = 0; i < patient.to_bone_mm.size.x(); ++i) {
        if (patient.to_bone_mm.at(i, j, k) > 0.0F) continue;
        const Eigen::Vector3i at = (structure_from_lattice * Vector3d(i, j, k)).array().round().cast<int>();
        if ((at.array() < 0).any() || (at.array() >= structure.size.array()).any() ||
            structure.at(at.x(), at.y(), at.z()) == 0)
          continue;
        for (std::size_t body = 0; body < patient.carried.size(); ++body) {
          sums[body] += patient.carried[body].at(i, j, k);
          all += patient.carried[body].at(i, j, k);
        }
      }
  if (!(all > 0.0)) return {};
  for (double& sum : sums) sum /= all;
  return sums;
}

std::vector<double> shares_at(std::span<const BodyShare> shares, const Vector3d& place_patient_mm) {
  std::vector<double> values;
  values.reserve(shares.size());
  for (const BodyShare& share : shares) {
    const Vector3d voxel = share.patient_from_voxel.inverse() * place_patient_mm;
    const Vector3d corner = voxel.array().floor();
    values.push_back(interpolate(share, corner.cast<int>(), voxel - corner) / 255.0);
  }
  return values;
}

}  // namespace isoshift
