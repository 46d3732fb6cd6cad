#include "setup/couch_scale.h"

#include <gtest/gtest.h>

#include "tests/support/pose_near.h"

namespace isoshift::couch_scale_test {
namespace {

using Eigen::Vector3d;

// The table of docs/dicom.md 5.2, in mm.
TEST(CouchScale, ReadOutsAreThoseOfDicomMd52) {
  const CouchReadOut iec{.position_mm = {-12.0, 1350.0, -135.0}, .angle_deg = 10.0};
  const CouchReadOut varian_iec = on_scale(CouchScale::kVarianIec, iec);
  EXPECT_THAT(varian_iec.position_mm, VectorNear(Vector3d(9988.0, 1350.0, 135.0), 1e-9));
  EXPECT_NEAR(varian_iec.angle_deg, 350.0, 1e-12);
  const CouchReadOut standard = on_scale(CouchScale::kVarianStandard, iec);
  EXPECT_THAT(standard.position_mm, VectorNear(Vector3d(988.0, 2350.0, 1135.0), 1e-9));
  EXPECT_NEAR(standard.angle_deg, 170.0, 1e-12);
  EXPECT_NEAR(on_scale(CouchScale::kVarianStandard, {.angle_deg = 190.0}).angle_deg, 350.0, 1e-12);
  EXPECT_THAT(on_scale(CouchScale::kIec61217, iec).position_mm, VectorNear(iec.position_mm, 0.0));
}

TEST(CouchScale, RaisedTablesCountDownFromATurn) {
  const CouchReadOut raised{.position_mm = {0.0, 0.0, 25.0}};
  EXPECT_NEAR(on_scale(CouchScale::kVarianIec, raised).position_mm.z(), 9975.0, 1e-9);
  EXPECT_EQ(on_scale(CouchScale::kVarianIec, {}).position_mm.z(), 0.0);
  EXPECT_EQ(on_scale(CouchScale::kVarianIec, {}).angle_deg, 0.0);
}

// What a display shows after a small move, minus before, has the sign promised.
TEST(CouchScale, SignsAreThoseOfTheReadOuts) {
  const CouchReadOut before{.position_mm = {30.0, 500.0, -140.0}, .angle_deg = 20.0};
  CouchReadOut after = before;
  after.position_mm += Vector3d(1.0, 2.0, 3.0);
  after.angle_deg += 4.0;
  for (const CouchScale scale : kCouchScales) {
    const CouchReadOut from = on_scale(scale, before), to = on_scale(scale, after);
    const auto [lateral, longitudinal, vertical, angle] = signs_on_scale(scale);
    EXPECT_THAT(Vector3d(to.position_mm - from.position_mm),
                VectorNear(Vector3d(lateral * 1.0, longitudinal * 2.0, vertical * 3.0), 1e-9));
    EXPECT_NEAR(to.angle_deg - from.angle_deg, angle * 4.0, 1e-9);
    EXPECT_EQ(couch_scale_from(to_string(scale)), scale);
  }
  EXPECT_EQ(couch_scale_from("Elekta"), std::nullopt);
}

}  // namespace
}  // namespace isoshift::couch_scale_test
