#include "drr/raycast/attenuation_texture.h"

#include <limits>
#include <type_traits>

namespace isoshift {
namespace {

Texture3d texture_of(const QuantizedVolume& volume) {
  return std::visit(
      [&]<class T>(const std::vector<T>& voxels) { return Texture3d(volume.size, std::span<const T>(voxels)); },
      volume.voxels);
}

// Textures return the largest integer as 1.
double largest_stored(const QuantizedVolume& volume) {
  return std::visit(
      []<class T>(const std::vector<T>&) {
        return std::is_integral_v<T> ? static_cast<double>(std::numeric_limits<T>::max()) : 1.0;
      },
      volume.voxels);
}

}  // namespace

AttenuationTexture::AttenuationTexture(const QuantizedVolume& volume)
    : texture(texture_of(volume)), unit_per_mm(volume.unit_per_mm * largest_stored(volume)) {}

}  // namespace isoshift
