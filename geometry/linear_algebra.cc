#include "geometry/linear_algebra.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>

namespace isoshift {

Eigen::MatrixXd product(const MatrixView& a, const MatrixView& b) { return a * b; }
Eigen::MatrixXd transposed_product(const MatrixView& a, const MatrixView& b) { return a.transpose() * b; }

Eigen::MatrixXd propagated(const MatrixView& j, const MatrixView& covariance) {
  return product(j, product(covariance, j.transpose()));
}

Eigen::MatrixXd pulled_back(const MatrixView& j, const MatrixView& form) {
  return transposed_product(j, product(form, j));
}

Eigen::MatrixXd inverse(const MatrixView& matrix) { return matrix.inverse(); }

Eigen::MatrixXd solve_symmetric(const MatrixView& symmetric, const MatrixView& right) {
  return Eigen::LDLT<Eigen::MatrixXd>(symmetric).solve(right);
}

Eigen::MatrixXd least_squares(const MatrixView& design, const MatrixView& values) {
  return Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(design).solve(values);
}

SymmetricEigen symmetric_eigen(const MatrixView& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(symmetric);
  return {.values = solver.eigenvalues(), .vectors = solver.eigenvectors()};
}

Eigen::VectorXd generalized_eigenvalues(const MatrixView& a, const MatrixView& b) {
  return Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd>(a, b, Eigen::EigenvaluesOnly).eigenvalues();
}

Eigen::Isometry3d rigid_motion_between(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to) {
  const Eigen::Vector3d from_mean = from.rowwise().mean(), to_mean = to.rowwise().mean();
  Eigen::Matrix3d s = Eigen::Matrix3d::Zero();
  for (Eigen::Index n = 0; n < from.cols(); ++n) s += (from.col(n) - from_mean) * (to.col(n) - to_mean).transpose();
  const Eigen::Vector3d turn(s(1, 2) - s(2, 1), s(2, 0) - s(0, 2), s(0, 1) - s(1, 0));
  Eigen::Matrix4d form;  // of quaternions (x, y, z, w)
  form.topLeftCorner<3, 3>() = s + s.transpose() - s.trace() * Eigen::Matrix3d::Identity();
  form.topRightCorner<3, 1>() = turn;
  form.bottomLeftCorner<1, 3>() = turn.transpose();
  form(3, 3) = s.trace();
  const SymmetricEigen eigen = symmetric_eigen(form);
  // All quaternions of the largest eigenvalue are best. The nearest of them to (0, 0, 0, 1) turns least; where there is
  // none, all are half a turn.
  constexpr double kRounding = 1e-9;
  Eigen::Vector4d best = Eigen::Vector4d::Zero();
  for (Eigen::Index n = 0; n < 4; ++n)
    if (eigen.values[n] >= (1.0 - kRounding) * eigen.values[3]) best += eigen.vectors(3, n) * eigen.vectors.col(n);
  if (best.norm() < kRounding) best = eigen.vectors.col(3);
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = Eigen::Quaterniond(best).normalized().toRotationMatrix();
  motion.translation() = to_mean - motion.linear() * from_mean;
  return motion;
}

}  // namespace isoshift
