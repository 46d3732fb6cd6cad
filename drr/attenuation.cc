#include "drr/attenuation.h"

#include <cmath>

#include "base/error.h"
#include "base/option_name.h"
#include "base/parallel.h"
#include "drr/attenuation_curve.h"

namespace isoshift {

void AttenuationModel::check() const {
  if (!std::isfinite(threshold_hu)) throw UsageError(option("threshold-hu") + " must be a finite number");
  if (!(std::isfinite(window_low_hu) && std::isfinite(window_high_hu) && window_low_hu < window_high_hu))
    throw UsageError(option("window", "LOW,HIGH") + " needs two finite HU values, LOW below HIGH");
}

float AttenuationModel::attenuation_per_mm(float hu, Beam beam) const { return AttenuationCurve(*this, beam)(hu); }

const Eigen::Affine3d& lattice_of(const AttenuationByBeam& attenuation_per_mm) {
  return attenuation_per_mm.begin()->second.patient_from_voxel;
}

Volume<float> attenuation_volume(const Volume<float>& ct_hu, const AttenuationModel& model, Beam beam) {
  Volume<float> volume(ct_hu.size, ct_hu.patient_from_voxel);
  const std::size_t of_slice = static_cast<std::size_t>(volume.size.x()) * volume.size.y();
  const AttenuationCurve attenuation(model, beam);
  parallel_for(0, volume.size.z(), [&](int k) {
    for (std::size_t n = k * of_slice; n != (k + 1) * of_slice; ++n) volume.voxels[n] = attenuation(ct_hu.voxels[n]);
  });
  return volume;
}

}  // namespace isoshift
