#pragma once
// The six numbers of a rigid motion: 0 to 2 along, 3 to 5 about three axes.

#include <Eigen/Geometry>
#include <array>
#include <cstddef>

namespace isoshift {

constexpr bool is_rotation(std::size_t axis) { return axis >= 3; }
constexpr const char* unit_of(std::size_t axis) { return is_rotation(axis) ? "deg" : "mm"; }

// Translation in mm, and the angles of R = Rz Rx Ry about x, y, z in degrees.
std::array<double, 6> components_of(const Eigen::Isometry3d& motion);

}  // namespace isoshift
