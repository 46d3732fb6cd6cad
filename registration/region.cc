#include "registration/region.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "drr/renderer_pyramid.h"
#include "registration/preprocess/image_operations.h"

namespace isoshift {
namespace {

constexpr double kMaskVoxelMm = 2.0;  // masks are projected in voxels of this size
constexpr float kInsideHu = 0.0F, kAirHu = -1000.0F;

// A renderer for which the mask is water and all else nothing. It projects masks only: always on the CPU.
std::unique_ptr<Renderer> renderer_of(const Volume<std::uint8_t>& mask) {
  Volume<float> hu(mask.size, mask.patient_from_voxel);
  std::ranges::transform(mask.voxels, hu.voxels.begin(), [](std::uint8_t in) { return in != 0 ? kInsideHu : kAirHu; });
  const Eigen::Vector3i block = (kMaskVoxelMm / hu.spacing_mm().array()).cast<int>().max(1);
  const CoarserCt coarser = coarser_ct(hu, {.threshold_hu = -500.0}, block);
  return make_renderer(RendererKind::kCpu, coarser.hu, coarser.model,
                       std::array{Beam::kKilovoltage, Beam::kMegavoltage},
                       RendererOptions{.precision = VolumePrecision::kU8});
}

// 1 where rays meet the mask, by more than the smear at its rim, and around that.
Image<std::uint8_t> shadow(Renderer& renderer, const XrayView& view, const Eigen::Isometry3d& room_from_patient,
                           int around_px) {
  XrayView of_mask = view;
  of_mask.beam = Beam::kKilovoltage;
  const RenderResult drr = renderer.render(std::span(&of_mask, 1), std::span(&room_from_patient, 1), PixelSet::all());
  constexpr float kRim = 0.02F;  // a millimeter of water
  Image<std::uint8_t> mask(view.columns, view.rows);
  std::ranges::transform(drr.line_integrals(0, 0), mask.pixels.begin(),
                         [](float value) { return value > kRim ? std::uint8_t{1} : std::uint8_t{0}; });
  return grown(mask, around_px);
}

}  // namespace

std::vector<CutEnds> beyond_the_ct(const Volume<float>& ct_hu, double threshold_hu, double reach_mm) {
  constexpr double kVoxelMm = 4.0;
  const Eigen::Vector3i block = (kVoxelMm / ct_hu.spacing_mm().array()).cast<int>().max(1);
  const Volume<float> coarse = coarser_ct(ct_hu, {.threshold_hu = threshold_hu}, block).hu;
  const Eigen::Vector3i whole = (ct_hu.size.array() / block.array()).max(1);  // a last, smaller block is half air
  const auto attenuates = [&](const Eigen::Vector3i& at) {
    return coarse.at(at.x(), at.y(), at.z()) > static_cast<float>(threshold_hu);
  };
  std::vector<CutEnds> result;
  for (int axis = 0; axis < 3; ++axis) {
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const int reach = static_cast<int>(std::ceil(reach_mm / coarse.spacing_mm()[axis]));
    const Eigen::Vector3i before = reach * Eigen::Vector3i::Unit(axis);
    Volume<std::uint8_t> beyond(whole + 2 * before,
                                coarse.patient_from_voxel * Eigen::Translation3d(-before.cast<double>()));
    bool is_cut = false;
    Eigen::Vector3i at;
    for (at[u] = 0; at[u] < whole[u]; ++at[u])
      for (at[v] = 0; at[v] < whole[v]; ++at[v])
        for (const int outward : {-1, 1}) {
          at[axis] = outward > 0 ? whole[axis] - 1 : 0;
          if (!attenuates(at)) continue;
          is_cut = true;
          Eigen::Vector3i out = at + before;
          for (int step = 1; step <= reach; ++step) {
            out[axis] += outward;
            beyond.at(out.x(), out.y(), out.z()) = 1;
          }
        }
    if (is_cut) result.push_back({std::move(beyond), ct_hu.patient_from_voxel.linear().col(axis).normalized()});
  }
  return result;
}

Volume<float> only_inside(const Volume<float>& ct_hu, const Volume<std::uint8_t>& mask) {
  Volume<float> result = ct_hu;
  std::ranges::transform(result.voxels, mask.voxels, result.voxels.begin(),
                         [](float hu, std::uint8_t in) { return in != 0 ? hu : kAirHu; });
  return result;
}

Volume<float> without(const Volume<float>& ct_hu, const Volume<std::uint8_t>& mask) {
  Volume<float> result = ct_hu;
  std::ranges::transform(result.voxels, mask.voxels, result.voxels.begin(),
                         [](float hu, std::uint8_t in) { return in != 0 ? kAirHu : hu; });
  return result;
}

ProjectedRegion::ProjectedRegion(const RegionOfInterest& region) {
  const auto is_empty = [](const Volume<std::uint8_t>& mask) {
    return std::ranges::none_of(mask.voxels, [](std::uint8_t in) { return in != 0; });
  };
  if (region.volume) inside_ = renderer_of(*region.volume);
  for (const Volume<std::uint8_t>& volume : region.excluded)
    if (!is_empty(volume)) outside_.push_back(renderer_of(volume));
  for (const CutEnds& ends : region.cut_ends) ends_.push_back({renderer_of(ends.columns), ends.along_patient});
}

void ProjectedRegion::restrict(FixedImage& image, const Eigen::Isometry3d& room_from_patient, double slack_mm) const {
  const int slack_px = static_cast<int>(std::lround(slack_mm * pixels_per_mm(image.view)));
  const auto only_where = [&](Renderer& of_mask, std::uint8_t value) {
    const Image<std::uint8_t> mask = shadow(of_mask, image.view, room_from_patient, slack_px);
    Image<std::uint8_t> field = image.field;
    for (std::size_t n = 0; n < mask.pixels.size(); ++n)
      if (mask.pixels[n] != value) field.pixels[n] = 0;
    return field;
  };
  const auto count = [](const Image<std::uint8_t>& field) {
    return static_cast<double>(std::ranges::count_if(field.pixels, std::identity()));
  };
  if (inside_) image.field = only_where(*inside_, 1);
  const auto exclude = [&](Renderer& outside, double min_left) {
    Image<std::uint8_t> field = only_where(outside, 0);
    if (count(field) < min_left * count(image.field)) return false;
    image.field = std::move(field);
    return true;
  };
  constexpr double kMinLeft = 0.1, kMinLeftAlong = 0.75;
  for (const auto& outside : outside_)
    if (!exclude(*outside, kMinLeft)) image.has_all_excluded = false;
  const Eigen::Vector3d looking = room_from_patient.linear().transpose() * image.view.central_direction_room();
  for (const Ends& ends : ends_) {
    const bool is_along = std::abs(looking.dot(ends.along_patient)) > 0.5 * std::numbers::sqrt2;
    exclude(*ends.renderer, is_along ? kMinLeftAlong : kMinLeft);
  }
}

}  // namespace isoshift
