#include "workflow/register/rendering_options.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "base/option_name.h"
#include "drr/gl/context.h"
#include "registration/gpu_check.h"

namespace isoshift {
void RenderingOptions::default_to_paper() {
  if (!attenuation) attenuation = "windowed";
  if (!precision && !is_oracle(kind())) precision = "u8";
}

std::optional<std::string> RenderingOptions::failed_gpu() const {
  const GlChoice choice = gl_choice_from(gl, gpu);
  const bool has_gpu = renderer == "auto" && choice.kind == GlDevice::kHardware && !why_no_gpu(choice.gpu);
  return has_gpu ? gpu_check(choice).failure : std::nullopt;
}

RendererKind RenderingOptions::kind() const {
  if (renderer == "auto") return why_cpu() ? RendererKind::kCpu : RendererKind::kRaycast;
  const auto known = renderer_kind_from(renderer);
  if (!known) throw UsageError(fmt::format("{}: there is no such renderer", option("renderer", renderer)));
  return *known;
}

std::optional<std::string> RenderingOptions::why_cpu() const {
  if (renderer != "auto") return std::nullopt;
  const GlChoice choice = gl_choice_from(gl, gpu);
  if (choice.kind == GlDevice::kSoftware) return option("gl", "software") + " asks for no GPU";
  if (auto none = why_no_gpu(choice.gpu)) return none;
  return failed_gpu();
}

AttenuationModel RenderingOptions::model() const {
  if (attenuation_name() != "physical" && attenuation_name() != "windowed")
    throw UsageError(fmt::format("{}: there is no such attenuation", option("attenuation", *attenuation)));
  AttenuationModel model;
  model.kind = attenuation_name() == "physical" ? AttenuationModel::Kind::kPhysical : AttenuationModel::Kind::kWindowed;
  model.threshold_hu = threshold_hu;
  if (!window.empty() && attenuation_name() != "windowed")
    throw UsageError(fmt::format("{} works only with {}", option("window"), option("attenuation", "windowed")));
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
  // A flag that the renderer does not have is an error.
  const auto refuse = [&](bool given, const std::string& flag, const char* of) {
    if (!given) return;
    const std::optional<std::string> why = why_cpu();
    throw UsageError(fmt::format("{} works only with {}, and the renderer is {}{}", flag, of, to_string(chosen),
                                 why ? fmt::format(" ({})", *why) : ""));
  };
  refuse(gl && !uses_gl(chosen), option("gl"), "renderers on OpenGL");
  refuse(gpu && !uses_gl(chosen), option("device"), "renderers on OpenGL");
  refuse(precision.value_or("f32") != "f32" && is_oracle(chosen), option("precision") + " below f32",
         "renderers other than references");
  refuse(block_edge && chosen != RendererKind::kRaycastCuberille, option("block-edge"), "raycast-cuberille");
  refuse(wobble && !splats, option("wobble"), "splatting");
  refuse(wobble_sigma_mm && !splats, option("wobble-sigma"), "splatting");
  refuse(wobble_seed && !splats, option("wobble-seed"), "splatting");
  refuse(deposit && !splats, option("deposit"), "splatting");

  RendererOptions result;
  result.gl = gl_choice_from(gl, gpu);
  if (chosen == RendererKind::kRaycast) {
    require_gpu_check(result.gl);
    result.rays_per_dispatch = rays_per_dispatch(gpu_check(result.gl).rendering.samples_per_second);
  }
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

void RenderingOptions::take_gpu_of(int process) {
  const int gpus = count_gpus();
  if (gpu || gpus < 2 || gl_choice_from(gl, gpu).kind != GlDevice::kHardware || !uses_gl(kind())) return;
  const std::string own = std::to_string(process % gpus);
  if (!why_no_gpu(own) && !gpu_check({GlDevice::kHardware, own}).failure) gpu = own;
}

void RenderingOptions::check() const {
  model().check();
  options().check(kind());
}

std::vector<std::pair<std::string, std::string>> RenderingOptions::settings() const {
  const RendererKind chosen = kind();
  const RendererOptions used = options();
  std::vector<std::pair<std::string, std::string>> settings;
  if (const auto why = why_cpu()) settings.emplace_back("chosen_because", *why);
  const VolumePrecision kept = is_oracle(chosen) ? VolumePrecision::kF32 : used.precision.value_or(kDefaultPrecision);
  settings.emplace_back("precision", to_string(kept));
  if (chosen == RendererKind::kRaycast) {
    const GpuCheck& checked = gpu_check(used.gl);
    settings.emplace_back("driver", checked.driver);
    settings.emplace_back("self_check", checked.words());
  }
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

GlChoice gl_choice_from(const std::optional<std::string>& gl, const std::optional<std::string>& gpu) {
  if (gl && *gl != "hardware" && *gl != "software")
    throw UsageError(fmt::format("{}: there is no such OpenGL", option("gl", *gl)));
  return {gl.value_or("hardware") == "hardware" ? GlDevice::kHardware : GlDevice::kSoftware, gpu.value_or("")};
}

}  // namespace isoshift
