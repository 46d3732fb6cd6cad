#include "registration/quadratic_model.h"

#include "geometry/linear_algebra.h"

namespace isoshift {

QuadraticModel QuadraticModel::by(const Eigen::Ref<const Eigen::MatrixXd>& per_parameter) const {
  QuadraticModel model{.value = value, .gradient = transposed_product(per_parameter, gradient), .curvature = {}};
  if (curvature.size() > 0) model.curvature = pulled_back(per_parameter, curvature);
  return model;
}

QuadraticModel& QuadraticModel::operator+=(const QuadraticModel& other) {
  value += other.value;
  gradient += other.gradient;
  curvature += other.curvature;
  return *this;
}

QuadraticModel weighted_sum(double weight_a, const QuadraticModel& a, double weight_b, const QuadraticModel& b) {
  QuadraticModel sum{.value = weight_a * a.value + weight_b * b.value,
                     .gradient = weight_a * a.gradient + weight_b * b.gradient,
                     .curvature = {}};
  if (a.curvature.size() > 0) sum.curvature = weight_a * a.curvature + weight_b * b.curvature;
  return sum;
}

}  // namespace isoshift
