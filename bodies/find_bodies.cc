#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "bodies/body_map.h"
#include "bodies/bone_regions.h"
#include "bodies/distance.h"
#include "bodies/lattice.h"
#include "bodies/pieces.h"
#include "bodies/vertebrae.h"

namespace isoshift {
namespace {

constexpr std::size_t kMostBodies = 254;  // labels are bytes

// A body that is being found: its voxels, and which bone it is a piece of.
struct Part {
  Body body;
  VoxelSet voxels;
  int bone = -1;
};

class Finder {
 public:
  Finder(const Volume<float>& ct_hu, const BodyOptions& options)
      : ct_(ct_hu), options_(options), hu_(on_patient_axes(ct_hu, options.lattice_mm)) {}

  BodyMap find(std::span<const DrawnBone> drawn) {
    BodyMap map;
    if (hu_.voxels.empty()) return map;
    edge_mm_ = hu_.spacing_mm().x();
    const PatientAndCouch dense = patient_and_couch(hu_);
    bone_ = Volume<std::uint8_t>(hu_.size, hu_.patient_from_voxel);
    for (std::size_t n = 0; n < bone_.voxels.size(); ++n)
      bone_.voxels[n] = dense.patient.voxels[n] != 0 && hu_.voxels[n] > static_cast<float>(options_.bone_hu) ? 1 : 0;
    const std::vector<Vertebra> vertebrae = find_vertebrae(ct_, hu_);
    is_trunk_ = is_trunk(vertebrae, hu_);
    if (is_trunk_) remove_contrast_agent(bone_, hu_, vertebrae);  // elsewhere no vessel is as thick as a bone
    take_vertebrae(vertebrae);
    take_other_bones(vertebrae);
    take_drawn(drawn, vertebrae);
    take_couch(dense.couch);
    if (parts_.size() > kMostBodies) parts_.resize(kMostBodies);
    return labeled(vertebrae);
  }

 private:
  void add(Body::Kind kind, std::string name, VoxelSet voxels, int bone) {
    for (const std::uint32_t n : voxels) bone_.voxels[n] = 0;
    Part part{.body = {}, .voxels = std::move(voxels), .bone = bone};
    part.body.kind = kind;
    part.body.name = std::move(name);
    parts_.push_back(std::move(part));
  }

  VoxelSet voxels_of(const DrawnBone& bone) const {
    const Eigen::Affine3d from_lattice = bone.mask.patient_from_voxel.inverse() * hu_.patient_from_voxel;
    VoxelSet voxels;
    for (int k = 0; k < hu_.size.z(); ++k)
      for (int j = 0; j < hu_.size.y(); ++j)
        for (int i = 0; i < hu_.size.x(); ++i)
          if (interpolated(bone.mask, from_lattice * Eigen::Vector3d(i, j, k), 0.0F) >= 0.5F)
            voxels.push_back(static_cast<std::uint32_t>(hu_.index(i, j, k)));
    return voxels;
  }

  // What a person has drawn replaces what was found there: the vertebra whose center it holds, and bodies of which it
  // covers half. From others it takes what it covers.
  void take_drawn(std::span<const DrawnBone> drawn, const std::vector<Vertebra>& vertebrae) {
    const std::size_t found = parts_.size();
    std::vector<bool> is_replaced(vertebrae.size());
    for (const DrawnBone& one : drawn) {
      VoxelSet voxels = voxels_of(one);
      if (voxels.empty()) continue;
      const auto is_drawn = [&](std::uint32_t n) { return std::ranges::binary_search(voxels, n); };
      std::vector<std::size_t> held;  // vertebrae that were found
      for (std::size_t v = 0; v < vertebrae.size(); ++v)
        if (!is_replaced[v] && is_drawn(voxel_at(vertebrae[v].center_patient_mm))) held.push_back(v);
      for (std::size_t p = 0; p < parts_.size(); ++p) {
        VoxelSet& others = parts_[p].voxels;
        const std::size_t before = others.size();
        std::erase_if(others, is_drawn);
        const bool is_other_bone = p >= vertebrae.size() && p < found;
        if (is_other_bone && 2 * others.size() <= before) others.clear();
      }
      if (held.size() != 1) {
        add(Body::Kind::kBone, one.name, std::move(voxels), next_bone_++);
        continue;
      }
      is_replaced[held.front()] = true;
      parts_[held.front()].body.name = one.name;
      parts_[held.front()].voxels = std::move(voxels);
    }
    const auto others = parts_.begin() + static_cast<std::ptrdiff_t>(vertebrae.size());
    parts_.erase(std::remove_if(others, parts_.end(), [](const Part& part) { return part.voxels.empty(); }),
                 parts_.end());
  }

  void take_vertebrae(const std::vector<Vertebra>& vertebrae) {
    std::vector<VoxelSet> voxels = bone_of(vertebrae, bone_);
    for (std::size_t v = 0; v < vertebrae.size(); ++v) {
      add(Body::Kind::kVertebra, fmt::format("vertebra {}", v + 1), std::move(voxels[v]), next_bone_++);
      parts_.back().body.is_cut = vertebrae[v].is_cut;
    }
  }

  // Thin bones beside the spine, from 60 mm below the lowest vertebra to the highest, or to the end of a CT without a
  // head: ribs, shoulder blades and collar bones.
  bool is_rib(const VoxelSet& voxels, const Volume<float>& depth, const std::vector<Vertebra>& vertebrae) const {
    constexpr float kThickMm = 9.0F;
    constexpr double kAsideMm = 25.0, kBelowMm = 60.0;
    if (!is_trunk_) return false;
    const bool is_headless = ends_below_head(vertebrae, hu_);
    double aside = 0.0;
    float deepest = 0.0F;
    std::size_t among = 0;
    for (const std::uint32_t n : voxels) {
      const Eigen::Vector3d at = patient_mm(n);
      deepest = std::max(deepest, depth.voxels[n]);
      aside += std::abs(at.x() - level_of(at, vertebrae).center_patient_mm.x()) / static_cast<double>(voxels.size());
      const bool is_among = at.z() > vertebrae.front().center_patient_mm.z() - kBelowMm &&
                            (is_headless || at.z() < vertebrae.back().center_patient_mm.z());
      among += is_among ? 1 : 0;
    }
    return deepest < kThickMm && aside > kAsideMm && 2 * among > voxels.size();
  }

  void take_other_bones(const std::vector<Vertebra>& vertebrae) {
    constexpr double kLeastMm3 = 1500.0, kNeckMm = 3.0;
    const auto least = static_cast<std::size_t>(kLeastMm3 / (edge_mm_ * edge_mm_ * edge_mm_));
    const Volume<float> depth = depth_mm(bone_);
    const std::vector<VoxelSet> wholes = connected_parts(bone_, least);
    Volume<float> kept(depth.size, depth.patient_from_voxel);
    for (const VoxelSet& whole : wholes)
      for (const std::uint32_t n : whole) kept.voxels[n] = depth.voxels[n];
    // All ribs of a side together: there are too many, and each shows too little, for bodies of their own.
    std::array<VoxelSet, 2> ribs;
    for (VoxelSet& part : parts_between_necks(kept, kNeckMm)) {
      if (part.size() < least) continue;
      if (is_rib(part, depth, vertebrae)) {
        for (const std::uint32_t n : part) {
          const Eigen::Vector3d at = patient_mm(n);
          ribs[at.x() > level_of(at, vertebrae).center_patient_mm.x() ? 1 : 0].push_back(n);
        }
        continue;
      }
      const int bone = next_bone_++;
      for (VoxelSet& piece : pieces_of(part, hu_.size, edge_mm_, options_.most_piece_mm))
        add(Body::Kind::kBone, {}, std::move(piece), bone);
    }
    for (int side = 0; side < 2; ++side) {
      std::ranges::sort(ribs[side]);
      if (ribs[side].empty()) continue;
      const int bone = next_bone_++;
      for (VoxelSet& piece : pieces_of(ribs[side], hu_.size, edge_mm_, options_.most_piece_mm))
        add(Body::Kind::kRib, {}, std::move(piece), bone);
    }
  }

  void take_couch(const Volume<std::uint8_t>& couch) {
    VoxelSet voxels;
    for (std::uint32_t n = 0; n < couch.voxels.size(); ++n)
      if (couch.voxels[n] != 0) voxels.push_back(n);
    if (!voxels.empty()) add(Body::Kind::kCouch, "couch", std::move(voxels), next_bone_++);
  }

  std::uint32_t voxel_at(const Eigen::Vector3d& at_patient_mm) const {
    const Eigen::Array3i at =
        (hu_.patient_from_voxel.inverse() * at_patient_mm).array().round().cast<int>().max(0).min(hu_.size.array() - 1);
    return static_cast<std::uint32_t>(hu_.index(at.x(), at.y(), at.z()));
  }

  Eigen::Vector3d patient_mm(std::uint32_t n) const {
    return hu_.patient_from_voxel * voxel_of(hu_.size, n).cast<double>();
  }

  // Vertebrae first, the couch last.
  void put_in_order() {
    std::vector<Part> ordered;
    ordered.reserve(parts_.size());
    const auto take = [&](auto&& wanted) {
      for (Part& part : parts_)
        if (wanted(part.body.kind)) ordered.push_back(part);
    };
    take([](Body::Kind kind) { return kind == Body::Kind::kVertebra; });
    take([](Body::Kind kind) { return kind != Body::Kind::kVertebra && kind != Body::Kind::kCouch; });
    take([](Body::Kind kind) { return kind == Body::Kind::kCouch; });
    parts_ = std::move(ordered);
  }

  BodyMap labeled(const std::vector<Vertebra>& vertebrae) {
    BodyMap map;
    map.labels = Volume<std::uint8_t>(hu_.size, hu_.patient_from_voxel);
    put_in_order();
    for (std::size_t p = 0; p < parts_.size(); ++p) {
      Part& part = parts_[p];
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (const std::uint32_t n : part.voxels) {
        map.labels.voxels[n] = static_cast<std::uint8_t>(p + 1);
        sum += patient_mm(n);
        part.body.box_patient_mm.extend(patient_mm(n));
      }
      part.body.center_patient_mm = sum / static_cast<double>(std::max<std::size_t>(part.voxels.size(), 1));
      part.body.volume_mm3 = static_cast<double>(part.voxels.size()) * edge_mm_ * edge_mm_ * edge_mm_;
      map.bodies.push_back(part.body);
    }
    for (std::size_t v = 0; v < vertebrae.size(); ++v) map.bodies[v].center_patient_mm = vertebrae[v].center_patient_mm;
    map.joints = joints_of(map, vertebrae);
    return map;
  }

  struct Contacts {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();  // of places, in patient mm
    int count = 0;
  };
  using ContactsByPair = std::map<std::pair<int, int>, Contacts>;

  // From a voxel of a body along an axis to the first voxel of another one, within a reach.
  static void add_contact(const BodyMap& map, const Eigen::Vector3i& from, int axis, int reach,
                          ContactsByPair& contacts) {
    const auto label_at = [&](const Eigen::Vector3i& at) { return map.labels.at(at.x(), at.y(), at.z()); };
    const auto is_bone = [&](int label) {
      return label > 0 && map.bodies[static_cast<std::size_t>(label) - 1].kind != Body::Kind::kCouch;
    };
    const int mine = label_at(from);
    if (!is_bone(mine)) return;
    Eigen::Vector3i to = from;
    for (int step = 1; step <= reach; ++step) {
      if (++to[axis] >= map.labels.size[axis]) return;
      const int other = label_at(to);
      if (other == mine) return;
      if (!is_bone(other)) continue;
      Contacts& there = contacts[std::minmax(mine - 1, other - 1)];
      there.sum += map.labels.patient_from_voxel * Eigen::Vector3d(0.5 * (from + to).cast<double>());
      ++there.count;
      return;
    }
  }

  // Where bodies come within a few voxels of each other.
  std::vector<Joint> joints_of(const BodyMap& map, const std::vector<Vertebra>& vertebrae) const {
    constexpr double kReachMm = 8.0;
    constexpr int kLeastContacts = 3;
    const int reach = std::max(1, static_cast<int>(std::lround(kReachMm / edge_mm_)));
    ContactsByPair contacts;
    const Eigen::Vector3i& size = map.labels.size;
    for (int axis = 0; axis < 3; ++axis)
      for (int k = 0; k < size.z(); ++k)
        for (int j = 0; j < size.y(); ++j)
          for (int i = 0; i < size.x(); ++i) add_contact(map, {i, j, k}, axis, reach, contacts);
    for (std::size_t v = 0; v + 1 < vertebrae.size(); ++v) {  // neighbors always have a disc
      const int a = static_cast<int>(v);
      contacts[{a, a + 1}] = {vertebrae[v].upper.center_patient_mm * kLeastContacts, kLeastContacts};
    }
    std::vector<Joint> joints;
    for (const auto& [pair, there] : contacts)
      if (there.count >= kLeastContacts)
        joints.push_back({.a = pair.first,
                          .b = pair.second,
                          .at_patient_mm = there.sum / there.count,
                          .is_stiff = parts_[pair.first].bone == parts_[pair.second].bone});
    return joints;
  }

  const Volume<float>& ct_;
  BodyOptions options_;
  Volume<float> hu_;
  double edge_mm_ = 0.0;
  bool is_trunk_ = false;
  Volume<std::uint8_t> bone_;  // what no body has taken
  std::vector<Part> parts_;
  int next_bone_ = 0;
};

}  // namespace

std::string_view to_string(Body::Kind kind) {
  switch (kind) {
    case Body::Kind::kBone: return "bone";
    case Body::Kind::kVertebra: return "vertebra";
    case Body::Kind::kRib: return "ribs";
    case Body::Kind::kCouch: return "couch";
  }
  return "";
}

BodyMap find_bodies(const Volume<float>& ct_hu, std::span<const DrawnBone> drawn, const BodyOptions& options) {
  return Finder(ct_hu, options).find(drawn);
}

}  // namespace isoshift
