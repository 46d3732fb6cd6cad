#include "cli/rendering_options.h"

#include <fmt/format.h>

#include <algorithm>

#include "drr/gl/context.h"
#include "geometry/error.h"

namespace isoshift {
namespace {

constexpr const char* kGroup = "Rendering";

// Throws UsageError if a flag was given that the renderer does not have.
void refuse(bool given, const char* flag, const char* of, RendererKind kind) {
  if (given)
    throw UsageError(fmt::format("{} means something to {} only, and the renderer is {}", flag, of, to_string(kind)));
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
    throw UsageError("--window means something to --attenuation windowed only");
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

void add_rendering_options(CLI::App& command, RenderingOptions& options) {
  std::vector<std::string> names = {"auto"};
  for (const RendererKind kind : kRendererKinds) names.emplace_back(to_string(kind));
  std::vector<std::string> precisions(kVolumePrecisions.size());
  std::ranges::transform(kVolumePrecisions, precisions.begin(),
                         [](VolumePrecision precision) { return std::string(to_string(precision)); });
  command
      .add_option("--renderer", options.renderer,
                  "What renders the DRRs. auto: raycast on a GPU, else cpu; siddon and trilinear are slow references; "
                  "the others are the founding paper's (docs/renderers.md)")
      ->check(CLI::IsMember(names))
      ->capture_default_str()
      ->group(kGroup);
  add_gl_option(command, options.gl);
  command
      .add_option("--attenuation", options.attenuation,
                  "From HU to attenuation: a physical curve, or the HU window [physical]")
      ->check(CLI::IsMember({"physical", "windowed"}))
      ->capture_default_str()
      ->group(kGroup);
  command.add_option("--threshold-hu", options.threshold_hu, "Voxels below count as nothing")
      ->type_name("HU")
      ->capture_default_str()
      ->group(kGroup);
  command.add_option("--window", options.window, "HU window of --attenuation windowed [-540,1500]")
      ->delimiter(',')
      ->expected(2)
      ->type_name("LOW,HIGH")
      ->group(kGroup);
  command.add_option("--precision", options.precision, "How voxels are kept: 8 or 16 bit integers, or floats [u16]")
      ->check(CLI::IsMember(precisions))
      ->group(kGroup);
  command.add_option("--block-edge", options.block_edge, "raycast-cuberille: edge of its blocks, voxels [2]")
      ->check(CLI::IsMember({1, 2, 4, 8}))
      ->group(kGroup);
  command.add_option("--wobble", options.wobble, "Splatting: what moves a little for every voxel [focus]")
      ->check(CLI::IsMember({"focus", "voxel"}))
      ->group(kGroup);
  command
      .add_option("--wobble-sigma", options.wobble_sigma_mm,
                  "Splatting: by how much; 0: not at all [a voxel at the isocenter is blurred by half its edge]")
      ->type_name("MM")
      ->group(kGroup);
  command.add_option("--wobble-seed", options.wobble_seed, "Splatting: the only source of its randomness [1]")
      ->type_name("N")
      ->group(kGroup);
  command
      .add_option("--deposit", options.deposit,
                  "Splatting: a voxel falls into one pixel, or is shared by four [nearest]")
      ->check(CLI::IsMember({"nearest", "bilinear"}))
      ->group(kGroup);
}

void add_gl_option(CLI::App& command, std::optional<std::string>& gl) {
  command.add_option("--gl", gl, "Of renderers on OpenGL: a GPU, or Mesa's llvmpipe on the CPU [hardware]")
      ->check(CLI::IsMember({"hardware", "software"}))
      ->group(kGroup);
}

GlDevice gl_device_from(const std::optional<std::string>& gl) {
  return gl.value_or("hardware") == "hardware" ? GlDevice::kHardware : GlDevice::kSoftware;
}

}  // namespace isoshift
