#include "bodies/bone_regions.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <queue>

#include "bodies/distance.h"

namespace isoshift {
namespace {

// Where a point lies about a vertebra: mm to the left, back and up from its center, and whether between its discs.
struct PlaceAbout {
  double left, back, up;
  bool is_between_discs;
};

PlaceAbout place_about(const Vertebra& vertebra, const Eigen::Vector3d& at_mm) {
  const Eigen::Vector3d up = (vertebra.upper.center_patient_mm - vertebra.lower.center_patient_mm).normalized();
  const Eigen::Vector3d left = Eigen::Vector3d::UnitY().cross(up).normalized();
  const Eigen::Vector3d from_center = at_mm - vertebra.center_patient_mm;
  const double below = (at_mm - vertebra.lower.center_patient_mm).dot(vertebra.lower.up_patient);
  const double above = (at_mm - vertebra.upper.center_patient_mm).dot(vertebra.upper.up_patient);
  return {from_center.dot(left), from_center.dot(up.cross(left)), from_center.dot(up), below >= 0.0 && above < 0.0};
}

bool is_in_body(const Vertebra& vertebra, const PlaceAbout& place, double margin_mm) {
  return place.is_between_discs && std::hypot(place.left, place.back) < vertebra.radius_mm + margin_mm;
}

// Transverse processes reach about 20 mm beyond the body, the spinous process about 50; further out lie ribs.
bool may_be_of(const Vertebra& vertebra, const PlaceAbout& place) {
  const double r = vertebra.radius_mm;
  const bool beside = place.back < 0.4 * r;
  return place.back > -(r + 5.0) && place.back < r + 50.0 && std::abs(place.left) < r + (beside ? 4.0 : 19.0) &&
         place.up > -2.6 * r - 0.6 * std::max(place.back - r, 0.0) && place.up < 1.8 * r;
}

// Calls work(i, j, k) for the voxels of a box about a point.
template <class T, class Work>
void for_box(const Volume<T>& volume, const Eigen::Vector3d& center_mm, double reach_mm, Work&& work) {
  const Eigen::Affine3d voxel_from_patient = volume.patient_from_voxel.inverse();
  const Eigen::Array3d center = (voxel_from_patient * center_mm).array();
  const double reach = reach_mm / volume.spacing_mm().x();
  const Eigen::Array3i low = (center - reach).floor().template cast<int>().max(0);
  const Eigen::Array3i high = (center + reach).ceil().template cast<int>().min(volume.size.array() - 1);
  for (int k = low.z(); k <= high.z(); ++k)
    for (int j = low.y(); j <= high.y(); ++j)
      for (int i = low.x(); i <= high.x(); ++i) work(i, j, k);
}

double mean_of(const Volume<float>& hu, const VoxelSet& voxels) {
  double sum = 0.0;
  for (const std::uint32_t n : voxels) sum += hu.voxels[n];
  return sum / static_cast<double>(std::max<std::size_t>(voxels.size(), 1));
}

constexpr double kNoBrighter = 1.25;  // than the brightest agent, in thin vessels and where it fades

// Bone more than 5 mm below its surface, without the vertebral bodies and what may belong to them.
Volume<std::uint8_t> deep_cores(const Volume<std::uint8_t>& bone, const Volume<float>& depths,
                                const std::vector<Vertebra>& vertebrae) {
  constexpr float kCoreMm = 5.0F;
  Volume<std::uint8_t> core(bone.size, bone.patient_from_voxel);
  for (std::size_t n = 0; n < core.voxels.size(); ++n) core.voxels[n] = depths.voxels[n] > kCoreMm ? 1 : 0;
  for (const Vertebra& vertebra : vertebrae)
    for_box(core, vertebra.center_patient_mm, 3.0 * vertebra.radius_mm, [&](int i, int j, int k) {
      const PlaceAbout place = place_about(vertebra, core.patient_from_voxel * Eigen::Vector3d(i, j, k));
      if (is_in_body(vertebra, place, 3.0) || (place.back > 0.0 && may_be_of(vertebra, place))) core.at(i, j, k) = 0;
    });
  return core;
}

// The mean HU of the rim of a core: bone near its surface, within 3 voxels of the core along the axes.
double rim_hu(const VoxelSet& core, const Volume<float>& hu, const Volume<float>& depths) {
  double sum = 0.0, count = 1e-9;
  for (const std::uint32_t n : core) {
    const Eigen::Vector3i at = voxel_of(hu.size, n);
    for (int axis = 0; axis < 3; ++axis)
      for (const int step : {-3, -2, 2, 3}) {
        const Eigen::Vector3i to = at + step * Eigen::Vector3i::Unit(axis);
        if ((to.array() < 0).any() || (to.array() >= hu.size.array()).any()) continue;
        const std::size_t m = hu.index(to.x(), to.y(), to.z());
        if (depths.voxels[m] < 1.0F || depths.voxels[m] > 4.5F) continue;
        sum += hu.voxels[m];
        ++count;
      }
  }
  return sum / count;
}

struct ContrastAgent {
  Volume<std::uint8_t> cores;
  double brightest_hu = 0.0;  // the mean of the brightest core; 0: there is no agent
};

// Cores whose rims are no brighter than they are: bone is, at its surface.
ContrastAgent contrast_agent_of(const Volume<std::uint8_t>& bone, const Volume<float>& hu,
                                const std::vector<Vertebra>& vertebrae) {
  constexpr double kRimToCore = 1.05, kSurelyHu = 350.0;
  constexpr std::size_t kLeastCore = 40;
  const Volume<float> depths = depth_mm(bone);
  ContrastAgent agent{.cores = Volume<std::uint8_t>(bone.size, bone.patient_from_voxel)};
  for (const VoxelSet& core : connected_parts(deep_cores(bone, depths, vertebrae), kLeastCore)) {
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    for (const std::uint32_t n : core)
      center += voxel_of(bone.size, n).cast<double>() / static_cast<double>(core.size());
    const double inside_hu = mean_of(hu, core);
    if (rim_hu(core, hu, depths) > kRimToCore * inside_hu) continue;
    // No large vessel lies behind the middle of a vertebra.
    const Eigen::Vector3d at_mm = bone.patient_from_voxel * center;
    if (inside_hu > kSurelyHu && at_mm.y() > level_of(at_mm, vertebrae).center_patient_mm.y()) continue;
    for (const std::uint32_t n : core) agent.cores.voxels[n] = 1;
    agent.brightest_hu = std::max(agent.brightest_hu, inside_hu);
  }
  return agent;
}

// What is left of thinner vessels: parts that are nowhere much brighter than the agent.
void remove_thin_vessels(Volume<std::uint8_t>& bone, const Volume<float>& hu, double brightest_hu) {
  for (const VoxelSet& part : connected_parts(bone, 1)) {
    std::vector<float> values;
    values.reserve(part.size());
    for (const std::uint32_t n : part) values.push_back(hu.voxels[n]);
    const auto high = values.begin() + static_cast<std::ptrdiff_t>(values.size() * 19 / 20);
    std::ranges::nth_element(values, high);
    if (*high < kNoBrighter * brightest_hu)
      for (const std::uint32_t n : part) bone.voxels[n] = 0;
  }
}

}  // namespace

PatientAndCouch patient_and_couch(const Volume<float>& hu) {
  constexpr float kDenseHu = -300.0F;
  constexpr double kLeastMm3 = 3000.0, kCouchLength = 0.5, kSheet = 0.25;
  PatientAndCouch result{Volume<std::uint8_t>(hu.size, hu.patient_from_voxel),
                         Volume<std::uint8_t>(hu.size, hu.patient_from_voxel)};
  Volume<std::uint8_t> dense(hu.size, hu.patient_from_voxel);
  std::ranges::transform(hu.voxels, dense.voxels.begin(), [](float value) { return value > kDenseHu ? 1 : 0; });
  const auto parts = connected_parts(dense, static_cast<std::size_t>(kLeastMm3 / std::pow(hu.spacing_mm().x(), 3.0)));
  for (std::size_t n = 0; n < parts.size(); ++n) {
    Eigen::AlignedBox3d box;
    for (const std::uint32_t voxel : parts[n]) box.extend(voxel_of(hu.size, voxel).cast<double>());
    const double filled = static_cast<double>(parts[n].size()) / (box.sizes().array() + 1.0).prod();
    // A limb may lie apart from the trunk, but fills its box; a couch is a sheet or a shell.
    const bool is_couch = n > 0 && box.sizes().z() > kCouchLength * hu.size.z() && filled < kSheet;
    for (const std::uint32_t voxel : parts[n]) (is_couch ? result.couch : result.patient).voxels[voxel] = 1;
  }
  return result;
}

void remove_contrast_agent(Volume<std::uint8_t>& bone, const Volume<float>& hu,
                           const std::vector<Vertebra>& vertebrae) {
  constexpr float kSurelyMm = 4.0F, kGrownMm = 8.0F;
  const ContrastAgent agent = contrast_agent_of(bone, hu, vertebrae);
  if (agent.brightest_hu == 0.0) return;
  const Volume<float> away = distance_mm(agent.cores);
  for (std::size_t n = 0; n < bone.voxels.size(); ++n)
    if (away.voxels[n] < kSurelyMm || (away.voxels[n] < kGrownMm && hu.voxels[n] < kNoBrighter * agent.brightest_hu))
      bone.voxels[n] = 0;
  remove_thin_vessels(bone, hu, agent.brightest_hu);
}

std::vector<VoxelSet> bone_of(const std::vector<Vertebra>& vertebrae, const Volume<std::uint8_t>& bone) {
  // Dijkstra's shortest ways through bone from all vertebral bodies at once.
  struct Front {
    float mm;
    std::uint32_t voxel;
    std::uint8_t vertebra;
    bool operator<(const Front& other) const { return mm > other.mm || (mm == other.mm && voxel > other.voxel); }
  };
  const auto edge_mm = static_cast<float>(bone.spacing_mm().x());
  std::vector<float> best(bone.voxels.size(), std::numeric_limits<float>::infinity());
  std::vector<VoxelSet> result(vertebrae.size());
  std::priority_queue<Front> fronts;
  for (std::size_t v = 0; v < vertebrae.size(); ++v)
    for_box(bone, vertebrae[v].center_patient_mm, 2.5 * vertebrae[v].radius_mm, [&](int i, int j, int k) {
      const PlaceAbout place = place_about(vertebrae[v], bone.patient_from_voxel * Eigen::Vector3d(i, j, k));
      const auto n = static_cast<std::uint32_t>(bone.index(i, j, k));
      const double margin_mm = bone.voxels[n] != 0 ? 1.0 : -1.0;
      if (!is_in_body(vertebrae[v], place, margin_mm) || best[n] == 0.0F) return;
      best[n] = 0.0F;
      fronts.push({0.0F, n, static_cast<std::uint8_t>(v)});
    });
  while (!fronts.empty()) {
    const Front front = fronts.top();
    fronts.pop();
    if (front.mm > best[front.voxel]) continue;
    best[front.voxel] = -1.0F;  // taken
    result[front.vertebra].push_back(front.voxel);
    const Eigen::Vector3i at = voxel_of(bone.size, front.voxel);
    for (int n = 0; n < 27; ++n) {
      const Eigen::Vector3i step(n % 3 - 1, n / 3 % 3 - 1, n / 9 - 1), to = at + step;
      if (n == 13 || (to.array() < 0).any() || (to.array() >= bone.size.array()).any()) continue;
      const auto m = static_cast<std::uint32_t>(bone.index(to.x(), to.y(), to.z()));
      const float mm = front.mm + edge_mm * step.cast<float>().norm();
      if (bone.voxels[m] == 0 || mm >= best[m]) continue;
      if (!may_be_of(vertebrae[front.vertebra],
                     place_about(vertebrae[front.vertebra], bone.patient_from_voxel * to.cast<double>())))
        continue;
      best[m] = mm;
      fronts.push({mm, m, front.vertebra});
    }
  }
  for (VoxelSet& voxels : result) std::ranges::sort(voxels);
  return result;
}

}  // namespace isoshift
