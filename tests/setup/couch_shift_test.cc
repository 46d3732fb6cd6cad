#include "setup/couch_shift.h"

#include <gtest/gtest.h>

#include <random>

#include "tests/support/pose_near.h"

namespace isoshift::couch_shift_test {
namespace {

using Eigen::Vector3d;

Eigen::Isometry3d setup_error(const Vector3d& translation_mm, double rz_deg, double rx_deg, double ry_deg) {
  Eigen::Isometry3d error = Eigen::Isometry3d::Identity();
  error.linear() = rotation_from_zxy({rad_from_deg(rz_deg), rad_from_deg(rx_deg), rad_from_deg(ry_deg)});
  error.translation() = translation_mm;
  return error;
}

TableAngles couch(double deg) { return {.support_rad = rad_from_deg(deg)}; }

// What the couch does to anything on it: the table top translates along its support's axes, then turns about the
// isocenter from its old angles to its new ones. Written down from the definition, not from couch_shift_for().
Eigen::Isometry3d couch_motion(const CouchShift& shift, const TableAngles& table) {
  const double c = std::cos(table.yaw_rad()), s = std::sin(table.yaw_rad());
  const Vector3d& d = shift.translation_mm;
  const Eigen::Matrix3d before = rotation_from_zxy(table.zxy());
  const Eigen::Matrix3d after =
      rotation_from_zxy({table.yaw_rad() + shift.change.z_rad, table.pitch_rad + shift.change.x_rad,
                         table.roll_rad + shift.change.y_rad});
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  motion.linear() = after * before.transpose();
  motion.translation() = motion.linear() * Vector3d(c * d.x() - s * d.y(), s * d.x() + c * d.y(), d.z());
  return motion;
}

void expect_shift(const CouchShift& shift, const Vector3d& translation_mm, const Vector3d& target_deg,
                  double tolerance) {
  EXPECT_THAT(shift.translation_mm, VectorNear(translation_mm, tolerance));
  EXPECT_THAT(
      Vector3d(deg_from_rad(shift.target.z_rad), deg_from_rad(shift.target.x_rad), deg_from_rad(shift.target.y_rad)),
      VectorNear(target_deg, tolerance));
}

TEST(CouchShift, IsThatOfDicomMd51) {
  const Eigen::Isometry3d error = setup_error({3, -2, 1.5}, 1, -0.5, 0.8);
  expect_shift(couch_shift_for(error, couch(0)), {-3, 2, -1.5}, {-0.992961, 0.513837, -0.791184}, 6e-7);
  expect_shift(couch_shift_for(error, couch(10)), {-2.607127, 2.490560, -1.5}, {9.006284, 0.368649, -0.868385}, 6e-7);
}

// 50 mm superior (HFS: toward the gantry).
TEST(CouchShift, SmallerCouchesLeaveWhatDicomMd51Says) {
  const Eigen::Isometry3d error = setup_error({3, -2, 1.5}, 1, -0.5, 0.8);
  const Vector3d superior(0, 50, 0);
  const auto left_over = [&](CouchDof dof, const Vector3d& point) {
    return left_over_mm(error, couch(0), applicable_shift(error, couch(0), dof, Vector3d::Zero()), point);
  };
  EXPECT_THAT(left_over(CouchDof::kFour, superior), VectorNear(Vector3d(-0.006, -0.002, -0.436), 6e-4));
  EXPECT_THAT(left_over(CouchDof::kThree, superior), VectorNear(Vector3d(-0.873, -0.010, -0.436), 6e-4));
  EXPECT_THAT(left_over(CouchDof::kSix, superior), VectorNear(Vector3d(0, 0, 0), 1e-12));
  EXPECT_THAT(left_over(CouchDof::kThree, Vector3d::Zero()), VectorNear(Vector3d(0, 0, 0), 1e-12));
}

// Where the couch cannot rotate, its translation brings the target's center right, and no longer the isocenter: 2
// degrees and 80 mm would leave 2.8 mm there.
TEST(CouchShift, SmallerCouchesBringTheTargetRight) {
  const Eigen::Isometry3d error = setup_error({3, -2, 1.5}, 0, 0, 2);
  const TableAngles table{.support_rad = rad_from_deg(25), .pitch_rad = rad_from_deg(1), .roll_rad = rad_from_deg(-2)};
  const Vector3d target(80, 0, 0);
  for (const CouchDof dof : {CouchDof::kThree, CouchDof::kFour}) {
    const CouchShift about_isocenter = applicable_shift(error, table, dof, Vector3d::Zero());
    EXPECT_NEAR(left_over_mm(error, table, about_isocenter, target).norm(), 2.8, 0.05);
    const CouchShift part = applicable_shift(error, table, dof, target);
    EXPECT_THAT(left_over_mm(error, table, part, target), VectorNear(Vector3d(0, 0, 0), 1e-9));
    EXPECT_NEAR(left_over_mm(error, table, part, Vector3d::Zero()).norm(), 2.8, 0.05);
    EXPECT_EQ(part.change.z_rad, about_isocenter.change.z_rad);
  }
  const CouchShift whole = applicable_shift(error, table, CouchDof::kSix, target);
  EXPECT_THAT(whole.translation_mm, VectorNear(couch_shift_for(error, table).translation_mm, 1e-12));
  EXPECT_THAT(left_over_mm(error, table, whole, Vector3d::Zero()), VectorNear(Vector3d(0, 0, 0), 1e-9));
}

// The same by a simulation of the couch's motion, at any table angles.
TEST(CouchShift, WhatIsLeftOverIsWhereTheMotionPutsAPoint) {
  const Eigen::Isometry3d error = setup_error({12, -8, 6}, 6, -5, 7);
  const TableAngles table{
      .support_rad = rad_from_deg(30), .pitch_rad = rad_from_deg(1.5), .roll_rad = rad_from_deg(-2)};
  const Vector3d point(20, 50, -30);
  for (const CouchDof dof : {CouchDof::kThree, CouchDof::kFour, CouchDof::kSix}) {
    const CouchShift part = applicable_shift(error, table, dof, Vector3d(-15, 25, 40));
    EXPECT_THAT(left_over_mm(error, table, part, point),
                VectorNear(Vector3d(couch_motion(part, table) * error * point - point), 1e-9));
    EXPECT_EQ(part.change.x_rad == 0.0, dof != CouchDof::kSix);
    EXPECT_EQ(part.change.z_rad == 0.0, dof == CouchDof::kThree);
  }
}

TEST(CouchShift, FixedVectorAtCouch30) {
  const CouchShift shift = couch_shift_for(setup_error({12, -8, 6}, 6, -5, 7), couch(30));
  EXPECT_THAT(shift.translation_mm, VectorNear(Vector3d(-6.392305, 12.928203, -6), 6e-7));
  EXPECT_NEAR(deg_from_rad(shift.change.z_rad), -5.569591, 6e-7);
  EXPECT_NEAR(deg_from_rad(shift.change.x_rad), 1.688093, 6e-7);
  EXPECT_NEAR(deg_from_rad(shift.change.y_rad), -8.428900, 6e-7);
}

TEST(CouchShift, UndoesAThousandRandomErrors) {
  std::mt19937_64 random(7);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int n = 0; n < 1000; ++n) {
    const TableAngles table{.support_rad = rad_from_deg(uniform(0, 360)),
                            .pitch_rad = rad_from_deg(uniform(-3, 3)),
                            .roll_rad = rad_from_deg(uniform(-3, 3))};
    const Eigen::Isometry3d planned =
        planned_room_from_patient(kPatientPositions[static_cast<std::size_t>(n) % 8], table,
                                  Vector3d(uniform(-200, 200), uniform(-200, 200), uniform(-900, 900)));
    const Eigen::Isometry3d error = setup_error({uniform(-30, 30), uniform(-30, 30), uniform(-30, 30)},
                                                uniform(-10, 10), uniform(-10, 10), uniform(-10, 10));
    const Eigen::Isometry3d actual = error * planned;
    const CouchShift shift = couch_shift_for(setup_error_from_poses(planned, actual), table);
    const Eigen::Isometry3d corrected = couch_motion(shift, table) * actual;
    // The patient's origin is up to 1 m off the isocenter: compare about the isocenter, as a setup error.
    const Eigen::Isometry3d left_over = setup_error_from_poses(planned, corrected);
    ASSERT_LT(left_over.translation().norm(), 1e-9) << "case " << n;
    ASSERT_LT((left_over.linear() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-9) << "case " << n;
  }
}

TEST(CouchShift, MerelyNegatedAnglesWouldFail) {
  const Eigen::Isometry3d error = setup_error({12, -8, 6}, 6, -5, 7);
  CouchShift shift = couch_shift_for(error, couch(30));
  const ZxyAngles angles = zxy_from_rotation(error.linear());
  shift.change = {.z_rad = -angles.z_rad, .x_rad = -angles.x_rad, .y_rad = -angles.y_rad};
  const Eigen::Isometry3d left_over = couch_motion(shift, couch(30)) * error;
  EXPECT_GT(deg_from_rad(Eigen::AngleAxisd(left_over.linear()).angle()), 1.0);
}

}  // namespace
}  // namespace isoshift::couch_shift_test
