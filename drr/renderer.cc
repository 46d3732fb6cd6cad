#include "drr/renderer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <stdexcept>

#include "base/error.h"
#include "base/option_name.h"
#include "drr/cpu/raycast.h"
#include "drr/cpu/siddon.h"
#include "drr/cpu/trilinear.h"
#include "drr/raycast/rasterized.h"
#include "drr/raycast/raycast.h"
#include "drr/splat/splat.h"

namespace isoshift {

std::string_view to_string(RendererKind kind) {
  switch (kind) {
    case RendererKind::kSiddon: return "siddon";
    case RendererKind::kTrilinear: return "trilinear";
    case RendererKind::kCpu: return "cpu";
    case RendererKind::kRaycast: return "raycast";
    case RendererKind::kRaycastBox: return "raycast-box";
    case RendererKind::kRaycastCuberille: return "raycast-cuberille";
    case RendererKind::kSplat: return "splat";
    case RendererKind::kSplatTexture: return "splat-texture";
    case RendererKind::kSplatBuffers: return "splat-buffers";
  }
  return "";
}

std::optional<RendererKind> renderer_kind_from(std::string_view name) {
  for (const RendererKind kind : kRendererKinds)
    if (to_string(kind) == name) return kind;
  return std::nullopt;
}

bool uses_gl(RendererKind kind) { return kind != RendererKind::kCpu && !is_oracle(kind); }

bool is_oracle(RendererKind kind) { return kind == RendererKind::kSiddon || kind == RendererKind::kTrilinear; }

bool is_splatting(RendererKind kind) {
  return kind == RendererKind::kSplat || kind == RendererKind::kSplatTexture || kind == RendererKind::kSplatBuffers;
}

RenderResult Renderer::render_with_derivatives(std::span<const XrayView>, std::span<const Eigen::Isometry3d>,
                                               const PixelSet&) {
  throw UsageError(fmt::format("the renderer {} has no derivatives", to_string(kind())));
}

double default_sigma_mm(SplatOptions::Wobble wobble, double largest_spacing_mm, const XrayView& view) {
  const double blur_mm = 0.5 * largest_spacing_mm;
  if (wobble == SplatOptions::Wobble::kVoxel) return blur_mm;
  const double sad_by_sid = view.pixel_from_room(2, 3);  // how far on the way to the receptor the room's origin lies
  if (!(sad_by_sid > 0.0 && sad_by_sid < 1.0))
    throw Error(
        "the receptor does not lie behind the isocenter, so the focal spot's wobble has no default.\n"
        "       Give it with " +
        option("wobble-sigma") + ", or use " + option("wobble", "voxel"));
  return blur_mm / (1.0 - sad_by_sid);
}

void RendererOptions::check(RendererKind kind) const {
  if (is_oracle(kind) && precision.value_or(VolumePrecision::kF32) != VolumePrecision::kF32)
    throw UsageError(fmt::format("{} is a reference and keeps the volume in f32: leave {} out",
                                 option("renderer", to_string(kind)), option("precision", to_string(*precision))));
  if (kind == RendererKind::kRaycastCuberille && block_edge != 1 && block_edge != 2 && block_edge != 4 &&
      block_edge != 8)
    throw UsageError(fmt::format("{}: expected 1, 2, 4 or 8 voxels", option("block-edge", fmt::to_string(block_edge))));
  if (splat.sigma_mm && !(std::isfinite(*splat.sigma_mm) && *splat.sigma_mm >= 0.0))
    throw UsageError(fmt::format("{}: expected 0 mm or more", option("wobble-sigma", fmt::to_string(*splat.sigma_mm))));
}

std::size_t PixelSet::count(std::span<const XrayView> views, std::size_t view) const {
  if (!of_view.empty()) return of_view[view].size();
  return static_cast<std::size_t>(views[view].columns) * views[view].rows;
}

PixelSet PixelSet::random(std::span<const XrayView> views, double fraction, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  PixelSet pixels;
  for (const XrayView& view : views) {
    std::vector<std::uint32_t> all(static_cast<std::size_t>(view.columns) * view.rows);
    std::iota(all.begin(), all.end(), 0U);
    const auto wanted = std::llround(std::clamp(fraction, 0.0, 1.0) * static_cast<double>(all.size()));
    std::ranges::sample(all, std::back_inserter(pixels.of_view.emplace_back()), wanted, random);
  }
  return pixels;
}

std::unique_ptr<Renderer> make_renderer(RendererKind kind, const Volume<float>& ct_hu, const AttenuationModel& model,
                                        std::span<const Beam> beams, const RendererOptions& options) {
  model.check();
  options.check(kind);
  switch (kind) {
    case RendererKind::kSiddon: return std::make_unique<SiddonRenderer>(ct_hu, model, beams);
    case RendererKind::kTrilinear: return std::make_unique<TrilinearRenderer>(ct_hu, model, beams);
    case RendererKind::kCpu: return std::make_unique<RaycastCpuRenderer>(ct_hu, model, beams, options);
    case RendererKind::kRaycast: return std::make_unique<RaycastGlRenderer>(ct_hu, model, beams, options);
    case RendererKind::kRaycastBox:
    case RendererKind::kRaycastCuberille:
      return std::make_unique<RasterizedRaycaster>(kind, ct_hu, model, beams, options);
    case RendererKind::kSplat:
    case RendererKind::kSplatTexture:
    case RendererKind::kSplatBuffers: return std::make_unique<SplatRenderer>(kind, ct_hu, model, beams, options);
  }
  return nullptr;
}

std::unique_ptr<Renderer> make_renderer(RendererKind kind, AttenuationByBeam attenuation_per_mm,
                                        const RendererOptions& options) {
  options.check(kind);
  if (kind == RendererKind::kTrilinear) return std::make_unique<TrilinearRenderer>(std::move(attenuation_per_mm));
  if (kind == RendererKind::kCpu) return std::make_unique<RaycastCpuRenderer>(attenuation_per_mm, options);
  throw std::logic_error(fmt::format("the renderer {} takes HU, not attenuation", to_string(kind)));
}

Image<float> image_of(const XrayView& view, std::span<const float> line_integrals) {
  Image<float> image(view.columns, view.rows);
  std::ranges::copy(line_integrals, image.pixels.begin());
  return image;
}

void require_not_empty(std::span<const float> line_integrals, std::string_view label) {
  if (std::ranges::any_of(line_integrals, [](float value) { return value != 0.0F; })) return;
  throw Error(fmt::format("{}: the DRR is empty: no ray meets anything above the threshold in the CT", label));
}

}  // namespace isoshift
