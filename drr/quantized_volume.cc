#include "drr/quantized_volume.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "base/large_vector.h"
#include "base/parallel.h"
#include "drr/attenuation_curve.h"

namespace isoshift {
namespace {

QuantizedVolume::Voxels storage(VolumePrecision precision, std::size_t count) {
  switch (precision) {
    case VolumePrecision::kU8: return large_vector<std::uint8_t>(count);
    case VolumePrecision::kU16: return large_vector<std::uint16_t>(count);
    case VolumePrecision::kF32: break;
  }
  return large_vector<float>(count);
}

// Of a volume that is not empty.
float highest_in(const Volume<float>& volume) {
  const auto of_slice = static_cast<std::ptrdiff_t>(volume.size.x()) * volume.size.y();
  std::vector<float> highest(static_cast<std::size_t>(volume.size.z()));
  parallel_for(0, volume.size.z(), [&](int k) {
    const auto slice = volume.voxels.begin() + k * of_slice;
    highest[static_cast<std::size_t>(k)] = *std::max_element(slice, slice + of_slice);
  });
  return *std::ranges::max_element(highest);
}

// What the largest integer stands for.
double largest_attenuation_per_mm(const Volume<float>& ct_hu, const AttenuationModel& model, Beam beam) {
  if (model.kind == AttenuationModel::Kind::kWindowed || ct_hu.voxels.empty()) return 1.0;
  const float highest = model.attenuation_per_mm(highest_in(ct_hu), beam);
  return highest > 0.0F ? highest : 1.0;
}

// `attenuation` turns a voxel into 1/mm; integers span 0 to `largest_per_mm`.
template <class Attenuation>
QuantizedVolume quantized_values(const Volume<float>& source, VolumePrecision precision, double largest_per_mm,
                                 const Attenuation& attenuation) {
  QuantizedVolume volume{.size = source.size, .voxels = storage(precision, source.voxels.size())};
  std::visit(
      [&]<class T>(std::vector<T>& voxels) {
        constexpr bool kInteger = std::is_integral_v<T>;
        if (kInteger) volume.unit_per_mm = largest_per_mm / static_cast<double>(std::numeric_limits<T>::max());
        const auto per_unit = static_cast<float>(1.0 / volume.unit_per_mm);
        const std::size_t of_slice = static_cast<std::size_t>(source.size.x()) * source.size.y();
        parallel_for(0, source.size.z(), [&](int k) {
          for (std::size_t n = k * of_slice; n != (k + 1) * of_slice; ++n) {
            const float value = per_unit * attenuation(source.voxels[n]);
            voxels[n] = static_cast<T>(kInteger ? value + 0.5F : value);
          }
        });
      },
      volume.voxels);
  return volume;
}

}  // namespace

std::string_view to_string(VolumePrecision precision) {
  switch (precision) {
    case VolumePrecision::kU8: return "u8";
    case VolumePrecision::kU16: return "u16";
    case VolumePrecision::kF32: return "f32";
  }
  return "";
}

std::optional<VolumePrecision> volume_precision_from(std::string_view name) {
  for (const VolumePrecision precision : kVolumePrecisions)
    if (to_string(precision) == name) return precision;
  return std::nullopt;
}

double QuantizedVolume::full_scale_per_mm() const {
  return std::visit(
      [&]<class T>(const std::vector<T>&) {
        return std::is_integral_v<T> ? unit_per_mm * static_cast<double>(std::numeric_limits<T>::max()) : unit_per_mm;
      },
      voxels);
}

QuantizedVolume quantized_attenuation(const Volume<float>& ct_hu, const AttenuationModel& model, Beam beam,
                                      VolumePrecision precision) {
  return quantized_values(ct_hu, precision, largest_attenuation_per_mm(ct_hu, model, beam),
                          AttenuationCurve(model, beam));
}

QuantizedVolume quantized(const Volume<float>& attenuation_per_mm, VolumePrecision precision) {
  const float largest = attenuation_per_mm.voxels.empty() ? 0.0F : highest_in(attenuation_per_mm);
  return quantized_values(attenuation_per_mm, precision, largest > 0.0F ? largest : 1.0,
                          [](float value) { return value; });
}

VoxelBox occupied_voxels(const QuantizedVolume& volume) {
  return std::visit([&](const auto& voxels) { return occupied_voxels(voxels.data(), volume.size); }, volume.voxels);
}

}  // namespace isoshift
