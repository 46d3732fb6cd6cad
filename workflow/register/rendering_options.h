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
  std::optional<std::string> attenuation, gl, precision, wobble, deposit;
  std::optional<double> wobble_sigma_mm;
  std::optional<std::uint32_t> wobble_seed;
  std::optional<int> block_edge;

  // Sets the options that the user has not set to those of the founding paper: 8-bit volumes of windowed HU.
  void default_to_paper();

  std::string attenuation_name() const { return attenuation.value_or("physical"); }
  RendererKind kind() const;  // "auto" is resolved: raycast on a hardware GPU, else cpu
  // The following throw UsageError for a flag that has no effect on the chosen renderer or attenuation.
  AttenuationModel model() const;
  RendererOptions options() const;
  void check() const;

  // Names and values of options(), for the result.
  std::vector<std::pair<std::string, std::string>> settings() const;
};

GlDevice gl_device_from(const std::optional<std::string>& gl);  // unset: hardware

}  // namespace isoshift
