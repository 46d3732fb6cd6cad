#pragma once
// How DRRs are rendered, as the user asks for it, for every command that renders.

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "drr/renderer.h"

namespace isoshift {

struct RenderingOptions {
  std::string renderer = "auto";
  double threshold_hu = AttenuationModel{}.threshold_hu;
  std::vector<double> window;
  // Unset unless the user sets them: an option that the chosen renderer does not have is refused, not ignored.
  std::optional<std::string> attenuation, gl, gpu, precision, wobble, deposit;
  std::optional<double> wobble_sigma_mm;
  std::optional<std::uint32_t> wobble_seed;
  std::optional<int> block_edge;

  // Sets the options that the user has not set to those of the founding paper: 8-bit volumes of windowed HU.
  void default_to_paper();

  std::string attenuation_name() const { return attenuation.value_or("physical"); }
  RendererKind kind() const;  // "auto" is resolved: raycast on a GPU that passes its self-check, else cpu
  std::optional<std::string> why_cpu() const;     // why "auto" is cpu; nothing where it is not
  std::optional<std::string> failed_gpu() const;  // why "auto" does not use a GPU that is there
  // The following throw UsageError for a flag that has no effect on the chosen renderer or attenuation, and options()
  // throws Error for a device that cannot be had or fails its self-check.
  AttenuationModel model() const;
  RendererOptions options() const;
  void check() const;

  // Of several processes that render at the same time, each takes another GPU, if there are several and none was named.
  void take_gpu_of(int process);

  // Names and values of options(), for the result.
  std::vector<std::pair<std::string, std::string>> settings() const;
};

// From --gl and --device; unset: hardware, and the first GPU that works.
GlChoice gl_choice_from(const std::optional<std::string>& gl, const std::optional<std::string>& gpu);

}  // namespace isoshift
