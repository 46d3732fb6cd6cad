#include "geometry/linear_algebra.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

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

// Whatever the rest, one point says how to move, and two how to turn the line between them.
TEST(LinearAlgebra, OfMotionsThatFitEquallyTheSmallestRotationIsFound) {
  const Eigen::Vector3d at(5.0, -7.0, 9.0), along(1.0, 2.0, -2.0), shift(4.0, -6.0, 3.0);
  EXPECT_THAT(rigid_motion_between(at, at + shift),
              PoseNear(Eigen::Isometry3d(Eigen::Translation3d(shift)), 1e-9, 1e-9));
  for (const Eigen::Vector3d& to : {Eigen::Vector3d(0.3, -4.0, 1.0), Eigen::Vector3d(along),
                                    Eigen::Vector3d(1.001 * along), Eigen::Vector3d(-along)}) {
    const Eigen::Matrix3Xd from_points = (Eigen::Matrix3Xd(3, 2) << at, at + along).finished();
    const Eigen::Matrix3Xd to_points = (Eigen::Matrix3Xd(3, 2) << at + shift, at + shift + to).finished();
    const Eigen::Isometry3d motion = rigid_motion_between(from_points, to_points);
    EXPECT_THAT(Eigen::Vector3d(motion.linear() * along.normalized()), VectorNear(to.normalized(), 1e-9));
    EXPECT_NEAR(motion.linear().determinant(), 1.0, 1e-12);
    EXPECT_NEAR(rotation_vector(motion.linear()).norm(),
                std::acos(std::clamp(along.normalized().dot(to.normalized()), -1.0, 1.0)), 1e-6);
    EXPECT_THAT(Eigen::Vector3d(motion * (at + 0.5 * along)), VectorNear(at + shift + 0.5 * to, 1e-9))
        << "the means meet";
  }
}

}  // namespace
}  // namespace isoshift::linear_algebra_test
