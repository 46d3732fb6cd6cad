#include "drr/raycast/attenuation_texture.h"

namespace isoshift {
namespace {

Texture3d texture_of(const QuantizedVolume& volume) {
  return std::visit(
      [&]<class T>(const std::vector<T>& voxels) { return Texture3d(volume.size, std::span<const T>(voxels)); },
      volume.voxels);
}

}  // namespace

AttenuationTexture::AttenuationTexture(const QuantizedVolume& volume)
    : texture(texture_of(volume)), unit_per_mm(volume.full_scale_per_mm()) {}

}  // namespace isoshift
