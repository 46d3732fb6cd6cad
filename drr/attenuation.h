#pragma once
// From HU to attenuation, per voxel and before any interpolation (docs/algorithms.md, "Attenuation").

#include <map>

#include "geometry/volume.h"
#include "geometry/xray_view.h"

namespace isoshift {

struct AttenuationModel {
  enum class Kind {
    kPhysical,  // linear attenuation coefficient by a bilinear HU curve, 1/mm
    kWindowed,  // Spoerk et al. 2012: HU windowed to 0..1, taken as 1/mm
  };

  Kind kind = Kind::kPhysical;
  double threshold_hu = -540.0;    // voxels below count as nothing; the paper's value
  double window_low_hu = -540.0;   // kWindowed: this HU and less becomes 0
  double window_high_hu = 1500.0;  // kWindowed: this HU and more becomes 1

  // Throws UsageError for an empty window or a value that is not finite.
  void check() const;

  // Attenuation of one voxel in 1/mm, never negative.
  float attenuation_per_mm(float hu, Beam beam) const;
};

// The whole CT seen by one beam quality.
Volume<float> attenuation_volume(const Volume<float>& ct_hu, const AttenuationModel& model, Beam beam);

// Attenuation in 1/mm as every beam quality sees it, all on one lattice.
using AttenuationByBeam = std::map<Beam, Volume<float>>;
const Eigen::Affine3d& lattice_of(const AttenuationByBeam& attenuation_per_mm);  // patient from voxel

}  // namespace isoshift
