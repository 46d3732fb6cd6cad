#include "drr/attenuation.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"

namespace isoshift {
namespace {

// mu = mu_water (1 + HU/1000) up to water and mu_water (1 + k HU/1000) above. k is larger in kV, where the calcium of
// bone absorbs by the photoelectric effect. Values of docs/algorithms.md, compared there with NIST's tables.
struct BeamCurve {
  double water_per_mm;
  double bone_slope;
};

BeamCurve curve_of(Beam beam) { return beam == Beam::kKilovoltage ? BeamCurve{0.0205, 1.6} : BeamCurve{0.0050, 0.95}; }

}  // namespace

void AttenuationModel::check() const {
  if (!std::isfinite(threshold_hu)) throw UsageError("--threshold-hu must be a finite number");
  if (!(std::isfinite(window_low_hu) && std::isfinite(window_high_hu) && window_low_hu < window_high_hu))
    throw UsageError("--window LOW,HIGH needs two finite HU values, LOW below HIGH");
}

float AttenuationModel::attenuation_per_mm(float hu, Beam beam) const {
  if (!(hu >= threshold_hu)) return 0.0F;
  if (kind == Kind::kWindowed)
    return static_cast<float>(std::clamp((hu - window_low_hu) / (window_high_hu - window_low_hu), 0.0, 1.0));
  const BeamCurve curve = curve_of(beam);
  const double relative = 1.0 + (hu > 0.0F ? curve.bone_slope : 1.0) * hu / 1000.0;
  return static_cast<float>(std::max(0.0, curve.water_per_mm * relative));
}

const Eigen::Affine3d& lattice_of(const AttenuationByBeam& attenuation_per_mm) {
  return attenuation_per_mm.begin()->second.patient_from_voxel;
}

Volume<float> attenuation_volume(const Volume<float>& ct_hu, const AttenuationModel& model, Beam beam) {
  Volume<float> volume(ct_hu.size, ct_hu.patient_from_voxel);
  const std::size_t of_slice = static_cast<std::size_t>(volume.size.x()) * volume.size.y();
  parallel_for(0, volume.size.z(), [&](int k) {
    for (std::size_t n = k * of_slice; n != (k + 1) * of_slice; ++n)
      volume.voxels[n] = model.attenuation_per_mm(ct_hu.voxels[n], beam);
  });
  return volume;
}

}  // namespace isoshift
