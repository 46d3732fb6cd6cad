#pragma once
// A function of some parameters near a point, up to second order.

#include <Eigen/Core>

namespace isoshift {

// value + gradient . p - p . curvature p / 2 at a small distance p from the point. The curvature is positive
// semidefinite, as Gauss-Newton makes it; it is empty where only the gradient is known.
struct QuadraticModel {
  double value = 0.0;
  Eigen::VectorXd gradient;
  Eigen::MatrixXd curvature;

  // The same as a function of other parameters; column n of `per_parameter` is how these parameters change with the
  // other number n.
  QuadraticModel by(const Eigen::Ref<const Eigen::MatrixXd>& per_parameter) const;

  // Of the same parameters, both with curvature or both without.
  QuadraticModel& operator+=(const QuadraticModel& other);
};

// The mean of two, weighted.
QuadraticModel weighted_sum(double weight_a, const QuadraticModel& a, double weight_b, const QuadraticModel& b);

}  // namespace isoshift
