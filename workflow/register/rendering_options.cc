#include "workflow/register/rendering_options.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "drr/gl/context.h"

namespace isoshift {
namespace {

// Throws UsageError if a flag was given that the renderer does not have.
void refuse(bool given, const char* flag, const char* of, RendererKind kind) {
  if (given) throw UsageError(fmt::format("{} works only with {}, and the renderer is {}", flag, of, to_string(kind)));
}

}  // namespace

void RenderingOptions::default_to_paper() {
  if (!attenuation) attenuation = "windowed";
  if (!precision && !is_oracle(kind())) precision = "u8";
}

RendererKind RenderingOptions::kind() const {
  if (renderer == "auto")
    return gl_device_from(gl) == GlDevice::kHardware && has_hardware_gl() ? RendererKind::kRaycast : RendererKind::kCpu;
  return renderer_kind_from(renderer).value();
}

AttenuationModel RenderingOptions::model() const {
  AttenuationModel model;
  model.kind = attenuation_name() == "physical" ? AttenuationModel::Kind::kPhysical : AttenuationModel::Kind::kWindowed;
  model.threshold_hu = threshold_hu;
  if (!window.empty() && attenuation_name() != "windowed")
    throw UsageError("--window works only with --attenuation windowed");
  if (!window.empty()) {
    model.window_low_hu = window[0];
    model.window_high_hu = window[1];
  }
  model.check();
  return model;
}

RendererOptions RenderingOptions::options() const {
  const RendererKind chosen = kind();
  const bool splats = is_splatting(chosen);
  refuse(gl && !uses_gl(chosen), "--gl", "renderers on OpenGL", chosen);
  refuse(precision.value_or("f32") != "f32" && is_oracle(chosen), "--precision below f32",
         "renderers other than references", chosen);
  refuse(block_edge && chosen != RendererKind::kRaycastCuberille, "--block-edge", "raycast-cuberille", chosen);
  refuse(wobble && !splats, "--wobble", "splatting", chosen);
  refuse(wobble_sigma_mm && !splats, "--wobble-sigma", "splatting", chosen);
  refuse(wobble_seed && !splats, "--wobble-seed", "splatting", chosen);
  refuse(deposit && !splats, "--deposit", "splatting", chosen);

  RendererOptions result;
  result.gl = gl_device_from(gl);
  if (precision) result.precision = volume_precision_from(*precision);
  if (block_edge) result.block_edge = *block_edge;
  if (wobble) result.splat.wobble = *wobble == "focus" ? SplatOptions::Wobble::kFocus : SplatOptions::Wobble::kVoxel;
  if (deposit)
    result.splat.deposit = *deposit == "nearest" ? SplatOptions::Deposit::kNearest : SplatOptions::Deposit::kBilinear;
  if (wobble_seed) result.splat.seed = *wobble_seed;
  result.splat.sigma_mm = wobble_sigma_mm;
  result.check(chosen);
  return result;
}

void RenderingOptions::check() const {
  model().check();
  options().check(kind());
}

std::vector<std::pair<std::string, std::string>> RenderingOptions::settings() const {
  const RendererKind chosen = kind();
  const RendererOptions used = options();
  std::vector<std::pair<std::string, std::string>> settings;
  const VolumePrecision kept = is_oracle(chosen) ? VolumePrecision::kF32 : used.precision.value_or(kDefaultPrecision);
  settings.emplace_back("precision", to_string(kept));
  if (chosen == RendererKind::kRaycastCuberille) settings.emplace_back("block_edge", fmt::to_string(used.block_edge));
  if (is_splatting(chosen)) {
    settings.emplace_back("wobble", used.splat.wobble == SplatOptions::Wobble::kFocus ? "focus" : "voxel");
    settings.emplace_back("wobble_sigma_mm", used.splat.sigma_mm ? fmt::to_string(*used.splat.sigma_mm)
                                                                 : "blurs by half a voxel at the isocenter");
    settings.emplace_back("wobble_seed", fmt::to_string(used.splat.seed));
    settings.emplace_back("deposit", used.splat.deposit == SplatOptions::Deposit::kNearest ? "nearest" : "bilinear");
  }
  return settings;
}

GlDevice gl_device_from(const std::optional<std::string>& gl) {
  return gl.value_or("hardware") == "hardware" ? GlDevice::kHardware : GlDevice::kSoftware;
}

}  // namespace isoshift
