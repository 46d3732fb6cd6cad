// The pictures of a scout show the part that the CT covers, from the side of the patient that they say.

#include "workflow/scout/scout_picture.h"

#include <gtest/gtest.h>

#include "tests/drr/test_views.h"

namespace isoshift::scout_picture_test {
namespace {

using Eigen::Vector3d;

TEST(ScoutPicture, IsThePartThatTheCtCoversWithItsDirections) {
  const Volume<float> ct = phantom_ct();
  const auto renderer = make_renderer(RendererKind::kCpu, ct, {}, kBothBeams);
  const XrayView view = line_scan_view(300, 280, 2.0, 0.0);  // the tube at +x, wider and longer than the CT
  FixedImage scout{.view = view,
                   .line_integral = Image<float>(view.columns, view.rows),
                   .field = Image<std::uint8_t>(view.columns, view.rows, 1)};
  const Eigen::Isometry3d found = Eigen::Isometry3d::Identity();
  const RenderResult drr = renderer->render(std::span(&view, 1), std::span(&found, 1), PixelSet::all());
  scout.line_integral = image_of(view, drr.line_integrals(0, 0));
  const Eigen::Isometry3d as_said(Eigen::Translation3d(0.0, 6.0, 0.0));
  std::vector<Vector3d> corners;
  corners.reserve(8);
  for (int n = 0; n < 8; ++n)
    corners.emplace_back(ct.patient_from_voxel * Vector3d((n & 1) != 0 ? ct.size.x() - 1 : 0,
                                                          (n & 2) != 0 ? ct.size.y() - 1 : 0,
                                                          (n & 4) != 0 ? ct.size.z() - 1 : 0));
  const ViewPicture picture = scout_picture(scout, *renderer, 2.0, {as_said, found}, corners);
  EXPECT_LT(picture.xray.columns, view.columns);
  EXPECT_LT(picture.xray.rows, view.rows);
  // The scout is the CT as found; where the files say, the CT lies three rows farther along y.
  for (int row = 10; row < picture.xray.rows - 10; row += 20)
    for (int column = 10; column < picture.xray.columns - 10; column += 20) {
      EXPECT_NEAR(picture.drr_found.at(column, row), picture.xray.at(column, row), 1) << column << " " << row;
      EXPECT_NEAR(picture.drr_planned.at(column, row + 3), picture.xray.at(column, row), 8) << column << " " << row;
    }
  // Rows run along y, posterior, downward.
  EXPECT_EQ(picture.directions[2], "A");
  EXPECT_EQ(picture.directions[3], "P");
  EXPECT_NEAR(picture.pixels_per_mm, 0.5, 1e-9);
}

TEST(ScoutPicture, ADifferenceIsBrightWhereTheScoutIsDenser) {
  Image<std::uint8_t> scout(2, 1, 100), ct(2, 1, 100);
  ct.at(1, 0) = 60;
  const Image<Rgb> shown = difference(scout, ct);
  EXPECT_EQ(shown.at(0, 0), (Rgb{128, 128, 128}));
  EXPECT_EQ(shown.at(1, 0), (Rgb{168, 168, 168}));
}

}  // namespace
}  // namespace isoshift::scout_picture_test
