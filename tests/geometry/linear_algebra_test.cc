#include "geometry/linear_algebra.h"

#include <gtest/gtest.h>

#include "geometry/rotation.h"
#include "tests/support/pose_near.h"

namespace isoshift::linear_algebra_test {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr double kRounding = 1e-11;

MatrixXd symmetric() { return (MatrixXd(3, 3) << 4, 1, -2, 1, 5, 0.5, -2, 0.5, 6).finished(); }

TEST(LinearAlgebra, SolvesWhatItsMatrixWasMultipliedWith) {
  const MatrixXd wanted = (MatrixXd(3, 2) << 1, -4, 2, 5, -3, 6).finished();
  EXPECT_LT((solve_symmetric(symmetric(), product(symmetric(), wanted)) - wanted).norm(), kRounding);
  EXPECT_LT((product(inverse(symmetric()), symmetric()) - MatrixXd::Identity(3, 3)).norm(), kRounding);
}

TEST(LinearAlgebra, LeastSquaresLeaveAResidualAcrossTheDesign) {
  const MatrixXd design = (MatrixXd(4, 2) << 1, 0, 1, 1, 1, 2, 1, 3).finished();
  const MatrixXd values = (MatrixXd(4, 1) << 1.1, 2.9, 5.2, 6.8).finished();
  EXPECT_LT(transposed_product(design, values - product(design, least_squares(design, values))).norm(), kRounding);
}

TEST(LinearAlgebra, FormsAndCovariancesChangeCoordinates) {
  const MatrixXd j = (MatrixXd(2, 3) << 1, 2, 3, -1, 0, 4).finished();
  EXPECT_LT((propagated(j, symmetric()) - j * symmetric() * j.transpose()).norm(), kRounding);
  EXPECT_LT((pulled_back(j.transpose(), symmetric()) - j * symmetric() * j.transpose()).norm(), kRounding);
}

TEST(LinearAlgebra, EigenvaluesAscendAndVectorsAreTheirs) {
  const SymmetricEigen eigen = symmetric_eigen(symmetric());
  EXPECT_LT(eigen.values[0], eigen.values[2]);
  EXPECT_LT((symmetric() * eigen.vectors - eigen.vectors * eigen.values.asDiagonal()).norm(), kRounding);
  const VectorXd growth = generalized_eigenvalues(2.0 * symmetric(), symmetric());
  EXPECT_LT((growth - VectorXd::Constant(3, 2.0)).norm(), kRounding);
}

TEST(LinearAlgebra, FindsTheRigidMotionBetweenPoints) {
  const Eigen::Matrix3Xd from = (Eigen::Matrix3Xd(3, 4) << 0, 50, 0, 10, 0, 0, 40, -20, 0, 5, 10, 60).finished();
  for (const double turn_deg : {0.0, 3.0, 90.0, 179.0, 180.0}) {
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    motion.linear() = rotation_from_vector(rad_from_deg(turn_deg) * Eigen::Vector3d(1, -2, 2) / 3.0);
    motion.translation() = Eigen::Vector3d(4, -6, 3);
    EXPECT_THAT(rigid_motion_between(from, motion * from), PoseNear(motion, 1e-9, 1e-6)) << turn_deg;
  }
}

}  // namespace
}  // namespace isoshift::linear_algebra_test
