#pragma once
// A quantized volume as a 3D texture: what all ray casters on OpenGL sample.

#include "drr/gl/objects.h"
#include "drr/quantized_volume.h"

namespace isoshift {

struct AttenuationTexture {
  Texture3d texture;
  double unit_per_mm;  // attenuation that a texture value of 1 stands for

  explicit AttenuationTexture(const QuantizedVolume& volume);
};

}  // namespace isoshift
