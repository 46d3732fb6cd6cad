#pragma once
// The couch shift of docs/dicom.md 5.1, written anew from its equations.

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <numbers>

namespace isoshift {

// IEC 61217 fixed axes at couch 0 from DICOM patient axes, of a patient in HFS (docs/dicom.md 2.2).
inline Eigen::Matrix3d fixed_from_patient() { return Eigen::Matrix3d{{1, 0, 0}, {0, 0, 1}, {0, -1, 0}}; }

inline Eigen::Matrix3d turned_deg(double yaw, double pitch, double roll) {
  const double rad = std::numbers::pi / 180.0;
  return (Eigen::AngleAxisd(yaw * rad, Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(pitch * rad, Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(roll * rad, Eigen::Vector3d::UnitY()))
      .toRotationMatrix();
}

// The shift of docs/dicom.md 5.1, written anew: anatomy planned at x is found at R x + t.
inline std::array<double, 6> shift_by_hand(const Eigen::Matrix3d& r, const Eigen::Vector3d& t, double yaw, double pitch,
                                           double roll) {
  const double deg = 180.0 / std::numbers::pi;
  const Eigen::Vector3d moved = turned_deg(-yaw, 0, 0) * -t;
  const Eigen::Matrix3d target = r.transpose() * turned_deg(yaw, pitch, roll);
  return {moved.x(),
          moved.y(),
          moved.z(),
          std::atan2(-target(0, 1), target(1, 1)) * deg - yaw,
          std::asin(target(2, 1)) * deg - pitch,
          std::atan2(-target(2, 0), target(2, 2)) * deg - roll};
}

}  // namespace isoshift
