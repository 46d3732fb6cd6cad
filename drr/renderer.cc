#include "drr/renderer.h"

#include <fmt/format.h>

#include <algorithm>

#include "drr/cpu/raycast.h"
#include "drr/cpu/siddon.h"
#include "drr/cpu/trilinear.h"
#include "drr/raycast/raycast.h"
#include "geometry/error.h"

namespace isoshift {

std::string_view to_string(RendererKind kind) {
  switch (kind) {
    case RendererKind::kSiddon: return "siddon";
    case RendererKind::kTrilinear: return "trilinear";
    case RendererKind::kCpu: return "cpu";
    case RendererKind::kRaycast: return "raycast";
  }
  return "";
}

std::optional<RendererKind> renderer_kind_from(std::string_view name) {
  for (const RendererKind kind : kRendererKinds)
    if (to_string(kind) == name) return kind;
  return std::nullopt;
}

std::size_t PixelSet::count(std::span<const XrayView> views, std::size_t view) const {
  if (!of_view.empty()) return of_view[view].size();
  return static_cast<std::size_t>(views[view].columns) * views[view].rows;
}

std::unique_ptr<Renderer> make_renderer(RendererKind kind, const Volume<float>& ct_hu, const AttenuationModel& model,
                                        std::span<const Beam> beams, GlDevice gl) {
  model.check();
  switch (kind) {
    case RendererKind::kSiddon: return std::make_unique<SiddonRenderer>(ct_hu, model, beams);
    case RendererKind::kTrilinear: return std::make_unique<TrilinearRenderer>(ct_hu, model, beams);
    case RendererKind::kCpu: return std::make_unique<RaycastCpuRenderer>(ct_hu, model, beams);
    case RendererKind::kRaycast: return std::make_unique<RaycastGlRenderer>(ct_hu, model, beams, gl);
  }
  return nullptr;
}

void require_not_empty(std::span<const float> line_integrals, std::string_view label) {
  if (std::ranges::any_of(line_integrals, [](float value) { return value != 0.0F; })) return;
  throw Error(fmt::format("{}: the DRR is empty: no ray meets anything above the threshold in the CT", label));
}

}  // namespace isoshift
