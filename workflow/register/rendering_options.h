#pragma once
// How DRRs are rendered, as a person asks for it: the same for every command that renders.

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
  // Unset unless asked for: what the chosen renderer does not have is refused, not ignored.
  std::optional<std::string> attenuation, gl, precision, wobble, deposit;
  std::optional<double> wobble_sigma_mm;
  std::optional<std::uint32_t> wobble_seed;
  std::optional<int> block_edge;

  // What the founding paper rendered, where nothing else is asked for: 8-bit volumes of windowed HU.
  void default_to_paper();

  std::string attenuation_name() const { return attenuation.value_or("physical"); }
  RendererKind kind() const;  // "auto" settled: raycast on a hardware GPU, else cpu
  // The following throw UsageError for a flag that means nothing to what was chosen.
  AttenuationModel model() const;
  RendererOptions options() const;
  void check() const;

  // What options() came to, by name, for the result.
  std::vector<std::pair<std::string, std::string>> settings() const;
};

GlDevice gl_device_from(const std::optional<std::string>& gl);  // unset: hardware

}  // namespace isoshift
