#pragma once

#include "tests/support/small_study.h"

namespace isoshift {

// For tests that search many times. One for all, which do not change it.
inline const SmallStudy& tiny_study() {
  static const SmallStudy made([] {
    PhantomOptions options = small_phantom();
    options.voxel_mm = 5.0;
    options.image_pixels = 72;
    return options;
  }());
  return made;
}

}  // namespace isoshift
