#pragma once
// The correlation of two lists near a point, as least squares (docs/algorithms.md, "Derivatives").

#include <algorithm>

#include "registration/quadratic_model.h"

namespace isoshift {

// From sums over two lists of norm 1: of x y, and of y's derivatives (columns) with x, with y and with each other.
inline QuadraticModel correlation_model(double value, const Eigen::VectorXd& along_x, const Eigen::VectorXd& along_y,
                                        const Eigen::MatrixXd& squares) {
  // Far from the optimum rho says nothing about the curvature; a floor keeps steps finite there.
  constexpr double kLeastCorrelation = 0.2;
  return {.value = value,
          .gradient = along_x - value * along_y,
          .curvature = std::max(kLeastCorrelation, value) * (squares - along_y * along_y.transpose())};
}

// What is there where a list is all 0.
inline QuadraticModel no_correlation(Eigen::Index parameters) {
  return {.value = 0.0,
          .gradient = Eigen::VectorXd::Zero(parameters),
          .curvature = Eigen::MatrixXd::Zero(parameters, parameters)};
}

// The correlation rho of a list x with a list y, without subtracting their means; `of_y` are y's derivatives by some
// parameters, a column each. With both of norm 1, 1 - rho = |x - y|^2 / 2; its curvature at the optimum is rho J'J,
// with J the derivatives of the normalized y. All is 0 where a list is.
template <class Vector, class Matrix>
QuadraticModel correlation_model(Vector x, Vector y, Matrix of_y) {
  const Eigen::Index count = of_y.cols();
  const auto x_norm = x.norm(), y_norm = y.norm();
  if (!(x_norm > 0 && y_norm > 0)) return no_correlation(count);
  x /= x_norm;
  y /= y_norm;
  of_y /= y_norm;
  const Eigen::VectorXd along_y = (of_y.transpose() * y).template cast<double>();
  Matrix squares = Matrix::Zero(count, count);
  squares.template selfadjointView<Eigen::Lower>().rankUpdate(of_y.transpose());
  squares = Matrix(squares.template selfadjointView<Eigen::Lower>());
  return correlation_model(x.dot(y), (of_y.transpose() * x).template cast<double>(), along_y,
                           squares.template cast<double>());
}

}  // namespace isoshift
