#include "registration/target/chosen_region.h"

#include <algorithm>
#include <utility>

#include "geometry/mask.h"

namespace isoshift {
namespace {

// Beyond the compared region the CT is rendered over this distance more, so that its cut surface is seen outside only.
constexpr double kRenderedBeyondMm = 15.0;

}  // namespace

void unite(Volume<std::uint8_t>& mask, const Volume<std::uint8_t>& other) {
  std::ranges::transform(mask.voxels, other.voxels, mask.voxels.begin(), std::ranges::max);
}

Volume<std::uint8_t> sphere_in(const Volume<float>& ct_hu, const Eigen::Vector3d& center_patient_mm, double radius_mm) {
  Volume<std::uint8_t> mask(ct_hu.size, ct_hu.patient_from_voxel);
  for (int k = 0; k < ct_hu.size.z(); ++k)
    for (int j = 0; j < ct_hu.size.y(); ++j)
      for (int i = 0; i < ct_hu.size.x(); ++i) {
        const Eigen::Vector3d at_patient_mm = ct_hu.patient_from_voxel * Eigen::Vector3d(i, j, k);
        mask.at(i, j, k) = (at_patient_mm - center_patient_mm).norm() <= radius_mm ? 1 : 0;
      }
  return mask;
}

ChosenRegion region_within(std::optional<Volume<std::uint8_t>> compared,
                           const std::optional<Volume<std::uint8_t>>& rendered, std::span<const ChosenVolume> chosen,
                           double margin_mm, const Volume<float>& ct_hu, double threshold_hu) {
  RegionOfInterest region;
  ChosenRegion result;
  if (rendered) result.rendered_ct = only_inside(ct_hu, dilated(*rendered, kRenderedBeyondMm));
  region.volume = std::move(compared);
  region.cut_ends = beyond_the_ct(ct_hu, threshold_hu);
  for (const ChosenVolume& volume : chosen) {
    if (!volume.is_excluded) continue;
    result.rendered_ct = without(result.rendered_ct.value_or(ct_hu), volume.mask);
    if (!volume.keeps_pixels) region.excluded.push_back(dilated(volume.mask, margin_mm));
  }
  result.projected = ProjectedRegion(region);
  return result;
}

ChosenRegion ball_about(const Eigen::Vector3d& center_patient_mm, double radius_mm,
                        std::span<const ChosenVolume> chosen, double margin_mm, const Volume<float>& ct_hu,
                        double threshold_hu) {
  const Volume<std::uint8_t> ball = sphere_in(ct_hu, center_patient_mm, radius_mm);
  std::optional<Volume<std::uint8_t>> rendered;
  for (const ChosenVolume& volume : chosen) {
    if (volume.is_excluded) continue;
    if (!rendered) rendered = ball;
    unite(*rendered, dilated(volume.mask, margin_mm));
  }
  return region_within(ball, rendered, chosen, margin_mm, ct_hu, threshold_hu);
}

}  // namespace isoshift
