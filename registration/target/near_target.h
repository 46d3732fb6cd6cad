#pragma once
// What a CT shows near a target.

#include <Eigen/Geometry>
#include <utility>
#include <vector>

#include "geometry/volume.h"
#include "registration/bodies/carriers.h"
#include "registration/target/planned_patient.h"
#include "setup/target.h"

namespace isoshift {

inline constexpr double kLeastBoneMm3 = 100.0;  // a small piece of rib, or a ball

// The target's center and surface, as planned.
std::vector<Eigen::Vector3d> points_patient_mm(const PlannedPatient& patient, const Target& target);

// Calls work(i, j, k) for the voxels within 20 mm of a place.
template <class T, class Work>
void for_voxels_near(const Volume<T>& volume, const Eigen::Vector3d& patient_mm, Work&& work) {
  const Eigen::Vector3i& size = volume.size;
  const Eigen::Vector3d center = volume.patient_from_voxel.inverse() * patient_mm;
  const Eigen::Vector3d spacing = volume.spacing_mm(), reach = kCarriersNearMm * spacing.cwiseInverse();
  const Eigen::Vector3i first = (center - reach).array().ceil().max(0.0).cast<int>();
  const Eigen::Vector3i last = (center + reach).array().floor().min(size.array().cast<double>() - 1.0).cast<int>();
  for (int k = first.z(); k <= last.z(); ++k)
    for (int j = first.y(); j <= last.y(); ++j)
      for (int i = first.x(); i <= last.x(); ++i)
        if ((Eigen::Vector3d(i, j, k) - center).cwiseProduct(spacing).norm() <= kCarriersNearMm) work(i, j, k);
}

}  // namespace isoshift
