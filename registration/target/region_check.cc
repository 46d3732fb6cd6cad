#include "registration/target/region_check.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "bodies/body_map.h"
#include "bodies/lattice.h"
#include "geometry/mask.h"
#include "registration/target/near_target.h"

namespace isoshift {
namespace {

constexpr float kAirHu = -400.0F;
constexpr double kLeastInBody = 0.2, kLeastSlicesWithBone = 1.0 / 3.0, kLeastOfTargetsBone = 0.25;

bool is_bone(float hu) { return hu >= static_cast<float>(BodyOptions().bone_hu); }

// 1 where no air leads to the edge of a slice, on coarse cubes: the patient with lungs and bowels, and a couch.
Volume<std::uint8_t> body_of(const Volume<float>& ct_hu) {
  constexpr double kEdgeMm = 4.0;
  const Volume<float> hu = on_patient_axes(ct_hu, kEdgeMm);
  Volume<std::uint8_t> body(hu.size, hu.patient_from_voxel, 1);
  const int columns = hu.size.x(), rows = hu.size.y();
  std::vector<std::pair<int, int>> open;
  for (int k = 0; k < hu.size.z(); ++k) {
    const auto enter = [&](int i, int j) {
      if (i < 0 || j < 0 || i >= columns || j >= rows || body.at(i, j, k) == 0 || hu.at(i, j, k) >= kAirHu) return;
      body.at(i, j, k) = 0;
      open.emplace_back(i, j);
    };
    for (int i = 0; i < columns; ++i) enter(i, 0), enter(i, rows - 1);
    for (int j = 0; j < rows; ++j) enter(0, j), enter(columns - 1, j);
    while (!open.empty()) {
      const auto [i, j] = open.back();
      open.pop_back();
      enter(i - 1, j), enter(i + 1, j), enter(i, j - 1), enter(i, j + 1);
    }
  }
  return body;
}

struct HeldBone {
  std::size_t voxels = 0, of_bone = 0;
  int slices = 0, slices_with_bone = 0;
  double from_isocenter_mm = 0.0;  // of the nearest voxel

  std::string in_words() const {
    return fmt::format("bone is {:.1f} % of it, on {} of {} slices; {:.0f} mm from the isocenter",
                       100.0 * static_cast<double>(of_bone) / static_cast<double>(std::max<std::size_t>(voxels, 1)),
                       slices_with_bone, slices, from_isocenter_mm);
  }
};

HeldBone bone_held_by(const Volume<std::uint8_t>& mask, const PlannedPatient& patient) {
  const Volume<float>& ct = *patient.ct_hu;
  HeldBone held{.from_isocenter_mm = distance_mm(mask, patient.isocenter_patient_mm())};
  for (int k = 0; k < ct.size.z(); ++k) {
    const std::size_t voxels = held.voxels, of_bone = held.of_bone;
    for (int j = 0; j < ct.size.y(); ++j)
      for (int i = 0; i < ct.size.x(); ++i) {
        if (mask.at(i, j, k) == 0) continue;
        ++held.voxels;
        held.of_bone += is_bone(ct.at(i, j, k)) ? 1 : 0;
      }
    held.slices += held.voxels > voxels ? 1 : 0;
    held.slices_with_bone += held.of_bone > of_bone ? 1 : 0;
  }
  return held;
}

// Bone near the target's center or surface, as a mask.
Volume<std::uint8_t> bone_near(const PlannedPatient& patient, const Target& target) {
  const Volume<float>& ct = *patient.ct_hu;
  Volume<std::uint8_t> bone(ct.size, ct.patient_from_voxel);
  for (const Eigen::Vector3d& point : points_patient_mm(patient, target))
    for_voxels_near(ct, point, [&](int i, int j, int k) {
      if (is_bone(ct.at(i, j, k))) bone.at(i, j, k) = 1;
    });
  return bone;
}

Volume<std::uint8_t> bone_in(const Volume<std::uint8_t>& drawn, const Volume<float>& ct) {
  Volume<std::uint8_t> bone = drawn;
  for (std::size_t n = 0; n < bone.voxels.size(); ++n)
    if (!is_bone(ct.voxels[n])) bone.voxels[n] = 0;
  return bone;
}

}  // namespace

bool is_in_body(const Volume<std::uint8_t>& mask, const Volume<float>& ct_hu) {
  std::size_t voxels = 0, dense = 0;
  for (std::size_t n = 0; n < mask.voxels.size(); ++n)
    if (mask.voxels[n] != 0) ++voxels, dense += ct_hu.voxels[n] >= kAirHu ? 1 : 0;
  const auto is_most = [&](std::size_t count) {
    return static_cast<double>(count) >= kLeastInBody * static_cast<double>(voxels);
  };
  if (is_most(dense)) return true;
  const Volume<std::uint8_t> body = body_of(ct_hu);
  const Eigen::Affine3d body_from_voxel = body.patient_from_voxel.inverse() * mask.patient_from_voxel;
  std::size_t inside = 0;
  for (int k = 0; k < mask.size.z(); ++k)
    for (int j = 0; j < mask.size.y(); ++j)
      for (int i = 0; i < mask.size.x(); ++i) {
        if (mask.at(i, j, k) == 0) continue;
        const Eigen::Array3i at = (body_from_voxel * Eigen::Vector3d(i, j, k)).array().round().cast<int>();
        const bool is_on_lattice = (at >= 0).all() && (at < body.size.array()).all();
        inside += is_on_lattice && body.at(at.x(), at.y(), at.z()) != 0 ? 1 : 0;
      }
  return is_most(inside);
}

std::optional<std::string> volume_doubt(const PlannedPatient& patient, const ChosenVolume& volume) {
  const HeldBone held = bone_held_by(volume.mask, patient);
  if (!is_in_body(volume.mask, *patient.ct_hu))
    return fmt::format(
        "{} lies outside of the body for the most part ({}): its contours may be of another CT, flipped "
        "or turned",
        volume.words, held.in_words());
  if (volume.is_excluded || held.slices_with_bone >= kLeastSlicesWithBone * held.slices) return std::nullopt;
  return fmt::format(
      "{} hardly holds bone ({}): X-rays do not show soft tissue, or its contours are of another CT, "
      "flipped or turned",
      volume.words, held.in_words());
}

std::vector<std::string> region_doubts(const PlannedPatient& patient, std::span<const ChosenVolume> chosen,
                                       double margin_mm, const Target& target,
                                       const std::optional<Volume<std::uint8_t>>& surrogate) {
  std::vector<std::string> doubts, words;
  std::optional<Volume<std::uint8_t>> compared;
  for (const ChosenVolume& volume : chosen) {
    if (auto doubt = volume.is_drawn && !volume.keeps_pixels ? volume_doubt(patient, volume) : std::nullopt)
      doubts.push_back(std::move(*doubt));
    if (volume.is_excluded) continue;
    words.push_back(fmt::format("{} ({})", volume.words, bone_held_by(volume.mask, patient).in_words()));
    if (compared)
      std::ranges::transform(compared->voxels, volume.mask.voxels, compared->voxels.begin(), std::ranges::max);
    else
      compared = volume.mask;
  }
  if (!compared) return doubts;
  const Volume<float>& ct = *patient.ct_hu;
  const Volume<std::uint8_t> bone = surrogate ? bone_in(*surrogate, ct) : bone_near(patient, target);
  const Volume<std::uint8_t> grown = dilated(*compared, margin_mm);
  double of_target_mm3 = 0.0, held_mm3 = 0.0;
  const double voxel_mm3 = ct.spacing_mm().prod();
  for (std::size_t n = 0; n < bone.voxels.size(); ++n) {
    if (bone.voxels[n] == 0) continue;
    of_target_mm3 += voxel_mm3;
    if (grown.voxels[n] != 0) held_mm3 += voxel_mm3;
  }
  const double wanted_mm3 = surrogate ? kLeastBoneMm3 : std::max(kLeastBoneMm3, kLeastOfTargetsBone * of_target_mm3);
  if (of_target_mm3 < kLeastBoneMm3 || held_mm3 >= wanted_mm3) return doubts;  // without bone the target has its doubt
  const std::string whose = surrogate ? "of the bones that carry the target (the site file)"
                                      : fmt::format("of the bone within {:.0f} mm of the target", kCarriersNearMm);
  doubts.push_back(fmt::format("the region that was chosen holds {:.0f} % {}, {:.0f} % are expected: {}",
                               100.0 * held_mm3 / of_target_mm3, whose,
                               100.0 * std::min(1.0, wanted_mm3 / of_target_mm3), fmt::join(words, "; ")));
  return doubts;
}

}  // namespace isoshift
