#include "geometry/patient_setup.h"

#include <gtest/gtest.h>

#include "tests/support/pose_near.h"

namespace isoshift::patient_setup_test {
namespace {

TEST(PatientSetup, AxesOfEveryPositionAreARotation) {
  for (const PatientPosition position : kPatientPositions) {
    const Eigen::Matrix3d axes = table_from_patient_axes(position);
    EXPECT_TRUE((axes * axes.transpose()).isIdentity(0.0)) << to_string(position);
    EXPECT_DOUBLE_EQ(axes.determinant(), 1.0) << to_string(position);
  }
}

TEST(PatientSetup, HfsMapsPatientToIecAsTheStandardSays) {
  // (X, Y, Z) in DICOM is (X, -Z, Y) in IEC (PS3.3 C.8.8.12.1.2; docs/dicom.md, 2.2).
  EXPECT_THAT(Eigen::Vector3d(table_from_patient_axes(PatientPosition::kHfs) * Eigen::Vector3d(1, 2, 3)),
              VectorNear(Eigen::Vector3d(1, 3, -2), 0.0));
}

TEST(PatientSetup, DefinedTermsReadBack) {
  for (const PatientPosition position : kPatientPositions)
    EXPECT_EQ(patient_position_from(to_string(position)), position);
  EXPECT_EQ(patient_position_from("SITTING"), std::nullopt);
  EXPECT_EQ(patient_position_from("hfs"), std::nullopt);
}

TEST(PatientSetup, PlannedPosePutsTheIsocenterAtTheOrigin) {
  const Eigen::Vector3d isocenter(10, -150, -420);
  for (const PatientPosition position : kPatientPositions) {
    const TableAngles table{.support_rad = 0.3, .pitch_rad = 0.02, .roll_rad = -0.03};
    EXPECT_THAT(Eigen::Vector3d(planned_room_from_patient(position, table, isocenter) * isocenter),
                VectorNear(Eigen::Vector3d::Zero().eval(), 1e-12));
  }
}

}  // namespace
}  // namespace isoshift::patient_setup_test
