#include "tests/support/cube_study.h"

#include "geometry/patient_setup.h"

namespace isoshift {

Study cube_study(int voxels, double voxel_mm, const Eigen::Vector3d& isocenter_mm,
                 const std::function<float(const Eigen::Vector3d& patient_mm)>& hu) {
  Eigen::Affine3d lattice(Eigen::Translation3d(Eigen::Vector3d::Constant(-0.5 * (voxels - 1) * voxel_mm)));
  lattice.scale(voxel_mm);
  CtSeries ct;
  ct.frame_of_reference_uid = "1.2.3";
  ct.hu = Volume<float>(Eigen::Vector3i::Constant(voxels), lattice);
  for (int k = 0; k < voxels; ++k)
    for (int j = 0; j < voxels; ++j)
      for (int i = 0; i < voxels; ++i) ct.hu.at(i, j, k) = hu(lattice * Eigen::Vector3d(i, j, k));
  Study study;
  study.ct = std::make_shared<const CtSeries>(std::move(ct));
  study.isocenter_patient_mm = isocenter_mm;
  study.planned_room_from_patient = planned_room_from_patient(PatientPosition::kHfs, study.table, isocenter_mm);
  return study;
}

}  // namespace isoshift
