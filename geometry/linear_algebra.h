#pragma once
// Dense linear algebra of small matrices. Eigen's inverses, decompositions and products of matrices whose sizes are
// known at run time cost every source that uses them 2 to 30 s to compile (bench/results/build-time.md): so they are
// compiled once, in linear_algebra.cc. What runs per pixel or per voxel uses Eigen's types of fixed size directly.

#include <Eigen/Geometry>

namespace isoshift {

using MatrixView = Eigen::Ref<const Eigen::MatrixXd>;

Eigen::MatrixXd product(const MatrixView& a, const MatrixView& b);             // a b
Eigen::MatrixXd transposed_product(const MatrixView& a, const MatrixView& b);  // a' b

// A covariance seen through a linear map: j c j'.
Eigen::MatrixXd propagated(const MatrixView& j, const MatrixView& covariance);
// A quadratic form in other coordinates x = j y: j' q j.
Eigen::MatrixXd pulled_back(const MatrixView& j, const MatrixView& form);

// Precondition: the matrix is square and regular.
Eigen::MatrixXd inverse(const MatrixView& matrix);

// x of `symmetric` x = `right`, by Cholesky's decomposition with pivots (LDL'). Precondition: semidefinite.
Eigen::MatrixXd solve_symmetric(const MatrixView& symmetric, const MatrixView& right);

// x with the smallest |design x - values|, by Householder's QR decomposition with column pivots.
Eigen::MatrixXd least_squares(const MatrixView& design, const MatrixView& values);

// Of a symmetric matrix: the eigenvalues, smallest first, and the eigenvectors, a column each.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
SymmetricEigen symmetric_eigen(const MatrixView& symmetric);
// Of the pencil a x = lambda b x, smallest first. Precondition: b is positive definite.
Eigen::VectorXd generalized_eigenvalues(const MatrixView& a, const MatrixView& b);

// The rigid motion that takes the columns of `from` closest to those of `to`, by a quaternion (Horn, JOSA A 4, 1987):
// Eigen's umeyama() does it by a decomposition that takes 20 s to compile. Of motions that do so equally, since the
// points are one or lie on a line, the one of the smallest rotation.
Eigen::Isometry3d rigid_motion_between(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to);

}  // namespace isoshift
