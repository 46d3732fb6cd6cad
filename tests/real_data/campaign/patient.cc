#include "tests/real_data/campaign/patient.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "io/dicom/ct_series.h"

namespace isoshift::campaign {

Patient read_patient(const std::filesystem::path& ct_folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(ct_folder)) files.push_back(entry.path());
  std::ranges::sort(files);
  Notes notes;
  CtSeries ct = read_ct_series(files, {}, notes, {});
  Patient patient;
  patient.size = ct.hu.size;
  patient.first_mm = ct.hu.patient_from_voxel.translation();
  patient.spacing_mm = ct.hu.patient_from_voxel.linear().diagonal();
  if (!ct.hu.patient_from_voxel.linear().isApprox(Eigen::Matrix3d(patient.spacing_mm.asDiagonal())) ||
      patient.spacing_mm.minCoeff() <= 0.0)
    throw Error(ct_folder.string() + ": expected axial slices with rows to the left and columns to the back");
  patient.hu.reserve(ct.hu.voxels.size());
  // Values outside the scanner's field of view are stored below air.
  for (const float hu : ct.hu.voxels)
    patient.hu.push_back(static_cast<std::int16_t>(std::lround(std::clamp(hu, -1000.0F, 8000.0F))));
  patient.identity = ct.identity;
  patient.frame_of_reference_uid = ct.frame_of_reference_uid;
  patient.position = ct.patient_position;
  if (patient.position != "HFS" && patient.position != "FFS")
    throw Error(ct_folder.string() + ": patient position " + patient.position + ", expected HFS or FFS");
  return patient;
}

}  // namespace isoshift::campaign
