#include "geometry/linear_algebra.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>

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
  return Eigen::Isometry3d(Eigen::umeyama(from, to, false));
}

Eigen::Matrix3d rotation_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  return Eigen::Quaterniond::FromTwoVectors(from, to).toRotationMatrix();
}

}  // namespace isoshift
