#pragma once
// An AttenuationModel for many voxels.

#include <algorithm>

#include "drr/attenuation.h"

namespace isoshift {

// mu = mu_water (1 + HU/1000) up to water and mu_water (1 + k HU/1000) above. k is larger in kV, where the calcium of
// bone absorbs by the photoelectric effect. Values of docs/algorithms.md, compared there with NIST's tables.
class AttenuationCurve {
 public:
  AttenuationCurve(const AttenuationModel& model, Beam beam)
      : model_(model),
        water_per_mm_(beam == Beam::kKilovoltage ? 0.0205 : 0.0050),
        bone_slope_(beam == Beam::kKilovoltage ? 1.6 : 0.95) {}

  // Attenuation of one voxel in 1/mm, never negative.
  float operator()(float hu) const {
    if (!(hu >= model_.threshold_hu)) return 0.0F;
    if (model_.kind == AttenuationModel::Kind::kWindowed)
      return static_cast<float>(
          std::clamp((hu - model_.window_low_hu) / (model_.window_high_hu - model_.window_low_hu), 0.0, 1.0));
    const double relative = 1.0 + (hu > 0.0F ? bone_slope_ : 1.0) * hu / 1000.0;
    return static_cast<float>(std::max(0.0, water_per_mm_ * relative));
  }

 private:
  AttenuationModel model_;
  double water_per_mm_, bone_slope_;
};

}  // namespace isoshift
