#pragma once
// Attenuation as renderers keep it in memory: 8 or 16 bit integers, or floats.

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <variant>
#include <vector>

#include "drr/attenuation.h"
#include "geometry/voxel_box.h"

namespace isoshift {

// Bits per voxel. The errors each causes: docs/renderers.md, "Precision".
enum class VolumePrecision {
  kU8,   // the founding paper's; coarse where metal stretches the range
  kU16,  // half the memory traffic of floats, an error far below that of interpolation
  kF32,
};

inline constexpr VolumePrecision kDefaultPrecision = VolumePrecision::kU16;
inline constexpr std::array kVolumePrecisions = {VolumePrecision::kU8, VolumePrecision::kU16, VolumePrecision::kF32};

std::string_view to_string(VolumePrecision precision);
std::optional<VolumePrecision> volume_precision_from(std::string_view name);

// Voxels in the order of Volume.
struct QuantizedVolume {
  using Voxels = std::variant<std::vector<std::uint8_t>, std::vector<std::uint16_t>, std::vector<float>>;

  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  Voxels voxels;
  double unit_per_mm = 1.0;  // attenuation that a stored 1 stands for

  // Attenuation that 1 stands for to OpenGL, which reads the largest integer as 1 and floats as they are.
  double full_scale_per_mm() const;
};

// Attenuation of a whole CT. Integers span 0 to the CT's largest attenuation, or with a HU window 0 to 1, and are
// rounded.
QuantizedVolume quantized_attenuation(const Volume<float>& ct_hu, const AttenuationModel& model, Beam beam,
                                      VolumePrecision precision);

// The same of attenuation that is known already, 1/mm; integers span 0 to its largest value.
QuantizedVolume quantized(const Volume<float>& attenuation_per_mm, VolumePrecision precision);

// The box of the voxels that are not 0.
VoxelBox occupied_voxels(const QuantizedVolume& volume);

}  // namespace isoshift
