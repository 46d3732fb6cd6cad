#pragma once
// The planning CT of a case, on an axis-parallel lattice in patient coordinates (LPS, mm).

#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "io/dicom/identity.h"

namespace isoshift::campaign {

struct Patient {
  Eigen::Vector3i size = Eigen::Vector3i::Zero();
  Eigen::Vector3d first_mm = Eigen::Vector3d::Zero();  // center of voxel (0, 0, 0)
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Ones();
  std::vector<std::int16_t> hu;
  Identity identity;
  std::string frame_of_reference_uid, position;  // HFS or FFS

  std::int16_t& at(int i, int j, int k) { return hu[(static_cast<std::size_t>(k) * size.y() + j) * size.x() + i]; }
  std::int16_t at(int i, int j, int k) const { return hu[(static_cast<std::size_t>(k) * size.y() + j) * size.x() + i]; }
  Eigen::Vector3d place_mm(int i, int j, int k) const {
    return first_mm + spacing_mm.cwiseProduct(Eigen::Vector3d(i, j, k));
  }
};

Patient read_patient(const std::filesystem::path& ct_folder);

}  // namespace isoshift::campaign
