#pragma once
// A smooth curve along the spine, by its length.

#include <Eigen/Core>
#include <vector>

namespace isoshift {

// Of a point of the curve, in patient coordinates. The axes are unit vectors.
struct CurveFrame {
  Eigen::Vector3d at_mm, up, left, back;  // up: along the curve, toward the head
};

class SpineCurve {
 public:
  static constexpr int kBeyondMm = 50;

  // Points a few mm apart, from the feet to the head; at least two. They are smoothed, and the curve goes on straight
  // for `beyond_mm` at both ends.
  explicit SpineCurve(const std::vector<Eigen::Vector3d>& points_patient_mm, double smoothing_mm = 14.0,
                      int beyond_mm = kBeyondMm);

  // Whole millimeters along the curve: 0 to length() - 1.
  int length() const { return static_cast<int>(points_.size()); }
  CurveFrame frame(double along_mm) const;

 private:
  std::vector<Eigen::Vector3d> points_;  // 1 mm apart
};

}  // namespace isoshift
