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
  QuadraticModel by(const Eigen::Ref<const Eigen::MatrixXd>& per_parameter) const {
    QuadraticModel model{.value = value, .gradient = per_parameter.transpose() * gradient, .curvature = {}};
    if (curvature.size() > 0) model.curvature = per_parameter.transpose() * curvature * per_parameter;
    return model;
  }

  // Of the same parameters, both with curvature or both without.
  QuadraticModel& operator+=(const QuadraticModel& other) {
    value += other.value;
    gradient += other.gradient;
    curvature += other.curvature;
    return *this;
  }
};

// The mean of two, weighted.
inline QuadraticModel weighted_sum(double weight_a, const QuadraticModel& a, double weight_b, const QuadraticModel& b) {
  QuadraticModel sum{.value = weight_a * a.value + weight_b * b.value,
                     .gradient = weight_a * a.gradient + weight_b * b.gradient,
                     .curvature = {}};
  if (a.curvature.size() > 0) sum.curvature = weight_a * a.curvature + weight_b * b.curvature;
  return sum;
}

}  // namespace isoshift
