#pragma once
// The self-check of an OpenGL device: whether it renders and compares as the CPU does. No result is computed by a
// device that has not passed it in the same process.

#include <cstddef>
#include <optional>
#include <string>

#include "drr/gl/device.h"
#include "drr/raycast/rendering_check.h"
#include "registration/similarity/similarity_check.h"

namespace isoshift {

struct GpuCheck {
  std::string device, driver;  // GL_RENDERER and GL_VERSION
  RenderingCheck rendering;
  SimilarityCheck similarity;
  double milliseconds = 0.0;           // that the check took, shaders compiled
  std::optional<std::string> failure;  // what is wrong, for people: with the device's name

  // "passed, line integrals within 0.006 (rms 0.002) of the largest, similarities within 5e-07"; or the failure.
  std::string words() const;
};

// Of the device of that choice, made once per process. Throws Error where it cannot be had at all.
const GpuCheck& gpu_check(const GlChoice& choice);

// Throws Error with what to do instead for a device that fails.
void require_gpu_check(const GlChoice& choice);

}  // namespace isoshift
