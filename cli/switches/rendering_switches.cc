#include "cli/switches/rendering_switches.h"

#include <fmt/format.h>

#include <algorithm>

namespace isoshift {
namespace {

constexpr const char* kGroup = "Rendering";

}  // namespace

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
  add_gl_options(command, options.gl, options.gpu);
  command
      .add_option("--attenuation", options.attenuation,
                  "From HU to attenuation: a physical curve, or the HU window [physical]")
      ->check(CLI::IsMember({"physical", "windowed"}))
      ->capture_default_str()
      ->group(kGroup);
  command.add_option("--threshold-hu", options.threshold_hu, "Voxels below this attenuate nothing")
      ->type_name("HU")
      ->capture_default_str()
      ->group(kGroup);
  command.add_option("--window", options.window, "HU window of --attenuation windowed [-540,1500]")
      ->delimiter(',')
      ->expected(2)
      ->type_name("LOW,HIGH")
      ->group(kGroup);
  command
      .add_option("--precision", options.precision, "How voxels are stored: integers of 8 or 16 bits, or floats [u16]")
      ->check(CLI::IsMember(precisions))
      ->group(kGroup);
  command.add_option("--block-edge", options.block_edge, "raycast-cuberille: edge of its blocks, voxels [2]")
      ->check(CLI::IsMember({1, 2, 4, 8}))
      ->group(kGroup);
  command.add_option("--wobble", options.wobble, "Splatting: what is displaced at random for every voxel [focus]")
      ->check(CLI::IsMember({"focus", "voxel"}))
      ->group(kGroup);
  command
      .add_option("--wobble-sigma", options.wobble_sigma_mm,
                  "Splatting: standard deviation of the displacement, 0 for none [blurs a voxel at the isocenter by "
                  "half its edge]")
      ->type_name("MM")
      ->group(kGroup);
  command.add_option("--wobble-seed", options.wobble_seed, "Splatting: seed of the displacements [1]")
      ->type_name("N")
      ->group(kGroup);
  command
      .add_option("--deposit", options.deposit,
                  "Splatting: a voxel adds to the nearest pixel, or is distributed over four [nearest]")
      ->check(CLI::IsMember({"nearest", "bilinear"}))
      ->group(kGroup);
}

void add_gl_options(CLI::App& command, std::optional<std::string>& gl, std::optional<std::string>& gpu) {
  command.add_option("--gl", gl, "For OpenGL renderers: a GPU, or Mesa's llvmpipe on the CPU [hardware]")
      ->check(CLI::IsMember({"hardware", "software"}))
      ->group(kGroup);
  command
      .add_option("--device", gpu,
                  "For OpenGL renderers: which of several GPUs, by its number or UUID (isoshift inspect --devices) "
                  "[the first that works]")
      ->check(CLI::Validator(
          [](const std::string& device) {
            return GlChoice(GlDevice::kHardware, device).is_number_or_uuid()
                       ? std::string()
                       : fmt::format("{} is neither a device's number nor a UUID of 32 hexadecimal digits", device);
          },
          "", "device"))
      ->type_name("N|UUID")
      ->group(kGroup);
}

}  // namespace isoshift
