#pragma once
// Where a registration began.

#include <Eigen/Geometry>
#include <string>

namespace isoshift {

// A pose from a file, from which the search began in place of the planned pose, or which was judged without a search.
struct Start {
  Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();  // IEC 61217 fixed, mm, about the isocenter
  std::string file, sha256;
  std::string set_by;  // who set the pose by hand; empty: a program found it
};

}  // namespace isoshift
