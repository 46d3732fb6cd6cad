#include "workflow/commission/known_poses.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "base/output_folder.h"
#include "geometry/rotation.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::known_poses_test {
namespace {

using testing::HasSubstr;

class KnownPosesTest : public testing::Test {
 protected:
  KnownPoses read(const std::string& text) {
    replace_text(folder_ / "poses.csv", text);
    return read_known_poses(folder_ / "poses.csv");
  }
  std::string refusal(const std::string& text) {
    try {
      read(text);
    } catch (const Error& error) {
      return error.what();
    }
    return "not refused";
  }

  TemporaryFolder folder_;
};

TEST_F(KnownPosesTest, AnglesAreThoseOfTheOneOrder) {
  const KnownPoses poses =
      read("rz_deg,session,x_mm,y_mm,z_mm,rx_deg,ry_deg\r\n90,\"a, b\",1,-2,3.5,0,0\r\n\r\n0,c,0,0,0,10,20\r\n");
  ASSERT_EQ(poses.by_session.size(), 2U);
  EXPECT_TRUE(poses.have_angles);
  EXPECT_TRUE((poses.by_session.at("a, b") * Eigen::Vector3d(1, 0, 0)).isApprox(Eigen::Vector3d(1, -1, 3.5)));
  EXPECT_TRUE(poses.by_session.at("c").linear().isApprox(rotation_x(rad_from_deg(10)) * rotation_y(rad_from_deg(20))));
}

TEST_F(KnownPosesTest, AnglesMayBeLeftOut) {
  const KnownPoses poses = read("session,x_mm,y_mm,z_mm\na,1,2,3\n");
  EXPECT_TRUE(poses.by_session.at("a").linear().isIdentity());
  EXPECT_FALSE(poses.have_angles);
}

TEST_F(KnownPosesTest, ColumnsMayBeInCmAndRad) {
  const KnownPoses poses = read("session,x_cm,y_mm,z_cm,rx_rad,ry_deg,rz_rad\na,1.5,2,-0.3,0,0,1.5707963267948966\n");
  EXPECT_TRUE(poses.by_session.at("a").translation().isApprox(Eigen::Vector3d(15, 2, -3)));
  EXPECT_TRUE(poses.by_session.at("a").linear().isApprox(rotation_z(rad_from_deg(90)), 1e-12));
  EXPECT_THAT(refusal("session,x_cm,y_mm,z_mm\na,200,2,3\n"), HasSubstr("from -100 to 100"));
}

TEST_F(KnownPosesTest, MistakesAreNamed) {
  EXPECT_THAT(refusal("session,x_mm,y_mm\na,1,2\n"), HasSubstr("has no column z_mm"));
  EXPECT_THAT(refusal("session,x_mm,y_mm,z_mm,x_cm\na,1,2,3,4\n"), HasSubstr("column \"x_cm\""));
  EXPECT_THAT(refusal("session,x_mm,y_mm,z_mm,x_mm\na,1,2,3,4\n"), HasSubstr("has the column x_mm twice"));
  EXPECT_THAT(refusal("session,x_mm,y_mm,z_mm\na,1,2\n"), HasSubstr("line 2: 3 cells, expected 4"));
  EXPECT_THAT(refusal("session,x_mm,y_mm,z_mm\na,1,2,\n"), HasSubstr("line 2, column z_mm: \"\""));
  EXPECT_THAT(refusal("session,x_mm,y_mm,z_mm\na,1,2,nan\n"), HasSubstr("column z_mm: \"nan\""));
  EXPECT_THAT(refusal("session,x_mm,y_mm,z_mm\na,1,2,1e9\n"), HasSubstr("from -1000 to 1000"));
  EXPECT_THAT(refusal("session,x_mm,y_mm,z_mm\na,1,2,3\na,1,2,3\n"), HasSubstr("line 3: session \"a\" is there twice"));
  EXPECT_THAT(refusal("session,x_mm,y_mm,z_mm\n"), HasSubstr("names no session"));
  EXPECT_THAT(refusal("session,x_mm,y_mm,z_mm,ry_deg\na,1,2,3,4\n"), HasSubstr("expected all or none"));
  EXPECT_THAT(refusal(std::string("\xFF\xFEs\0e\0", 6)), HasSubstr("is in UTF-16, expected UTF-8"));
  try {
    read_known_poses(folder_.path());
    FAIL() << "not refused";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("is a folder, expected a file"));
  }
}

}  // namespace
}  // namespace isoshift::known_poses_test
