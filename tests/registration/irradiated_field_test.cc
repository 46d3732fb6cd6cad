#include "registration/preprocess/irradiated_field.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "geometry/rotation.h"
#include "registration/preprocess/preprocess.h"
#include "tests/support/collimated_xray.h"

namespace isoshift::irradiated_field_test {
namespace {

using Origin = IrradiatedField::Origin;
using testing::HasSubstr;

IrradiatedField field_of(const XrayImage& xray) { return find_irradiated_field(xray, pixels_per_mm(xray.view)); }

// A pixel of `xray` for a point of the isocenter plane, mm to the right and up as displayed.
Eigen::Vector2d pixel_at(const XrayImage& xray, double x_mm, double y_mm) {
  const double scale = pixels_per_mm(xray.view);
  return {0.5 * (xray.view.columns - 1) + scale * x_mm, 0.5 * (xray.view.rows - 1) - scale * y_mm};
}

DeclaredAperture aperture(const XrayImage& xray, const Eigen::Vector2d& lower_mm, const Eigen::Vector2d& upper_mm) {
  return {.corners_px = {pixel_at(xray, lower_mm.x(), lower_mm.y()), pixel_at(xray, upper_mm.x(), lower_mm.y()),
                         pixel_at(xray, upper_mm.x(), upper_mm.y()), pixel_at(xray, lower_mm.x(), upper_mm.y())}};
}

// Where a sure field may end inside of its sides, the compared pixels keep off by as much.
double surely_within_mm(const IrradiatedField& field) { return std::max(1.0, field.keep_off_mm); }

// Fields of 4 to 20 cm over bone, air and metal, with leakage of 0 to 2 %. Other seeds than those that the program was
// tuned on (1 to 500, 2001 to 2600, 3001 to 3300, 4001 to 4300).
TEST(IrradiatedField, AHundredFieldsAreFoundWithinAMillimeter) {
  int within = 0, wrong_and_sure = 0, not_sure = 0;
  double largest_mm = 0.0;
  for (std::uint64_t seed = 1001; seed <= 1100; ++seed) {
    const CollimatedXray scene = random_collimated_xray(seed);
    const XrayImage xray = xray_of(scene);
    const IrradiatedField field = field_of(xray);
    const double error_mm = field_error_mm(scene, xray.view, field.corners_px);
    largest_mm = std::max(largest_mm, error_mm);
    within += error_mm <= 1.0;
    not_sure += !field.is_sure();
    if (field.is_sure() && error_mm > surely_within_mm(field)) ++wrong_and_sure;
    if (error_mm > 1.0 || !field.is_sure())
      std::cout << "seed " << seed << ": " << error_mm << " mm; " << field.doubt << '\n';
  }
  std::cout << within << " of 100 within 1 mm, the worst " << largest_mm << " mm; not sure: " << not_sure << '\n';
  EXPECT_EQ(within, 100);
  EXPECT_EQ(wrong_and_sure, 0);
  EXPECT_LE(not_sure, 8);
}

// Fields that were found at another place, and said to be sure, when each side was measured by itself: drawn to a skin
// line, to a couch or to a broad penumbra, or taken for a strip of air since they leave the isocenter out.
TEST(IrradiatedField, FieldsThatWereOnceWrongAndSureAreFoundOrNotSure) {
  for (const std::uint64_t seed : {436, 445, 2017, 2023, 2048, 2275, 2328, 2408, 2430, 2434, 2486, 2535, 2557, 9024}) {
    const CollimatedXray scene = random_collimated_xray(seed);
    const XrayImage xray = xray_of(scene);
    const IrradiatedField field = field_of(xray);
    const double error_mm = field_error_mm(scene, xray.view, field.corners_px);
    EXPECT_TRUE(error_mm <= surely_within_mm(field) || !field.is_sure())
        << "seed " << seed << ": " << error_mm << " mm, sure";
  }
}

// Dense bone along an edge scatters the places at which its blocks see it by more than a millimeter, but nothing else
// than a collimator makes such edges on all four sides.
TEST(IrradiatedField, AnEdgeOverDenseBoneIsSureWhereTheOtherEdgesArePlain) {
  for (const std::uint64_t seed : {2028, 2194, 2262, 2395, 2537}) {
    const CollimatedXray scene = random_collimated_xray(seed);
    const XrayImage xray = xray_of(scene);
    const IrradiatedField field = field_of(xray);
    EXPECT_TRUE(field.is_sure()) << "seed " << seed << ": " << field.doubt;
    EXPECT_LE(field_error_mm(scene, xray.view, field.corners_px), 1.0) << "seed " << seed;
  }
}

// The outline of a patient, rods and a couch are no collimator.
TEST(IrradiatedField, AnOpenFieldIsTheWholeReceptor) {
  for (std::uint64_t seed = 1101; seed <= 1140; ++seed) {
    const CollimatedXray scene = opened(random_collimated_xray(seed));
    const IrradiatedField field = field_of(xray_of(scene));
    EXPECT_EQ(field.origin, Origin::kWholeReceptor) << "seed " << seed;
    EXPECT_TRUE(field.is_sure()) << "seed " << seed << ": " << field.doubt;
    ASSERT_EQ(field.corners_px.size(), 4U);
    for (const Eigen::Vector2d& corner : field.corners_px)
      for (int axis = 0; axis < 2; ++axis) EXPECT_NEAR(std::abs(corner[axis] - 255.5), 256.0, 1e-6) << "seed " << seed;
  }
}

// A flat chest, seen edge-on, is as straight and as dark beyond as a collimator; there is nothing to compare before it.
TEST(IrradiatedField, AStripOfAirBesideAFlatPatientIsNotWhatIsCompared) {
  XrayImage xray = xray_of(opened({.body = CollimatedXray::Body::kNone}));
  constexpr double kChestColumn = 50.3;
  for (int row = 0; row < xray.values.rows; ++row)
    for (int column = 0; column < xray.values.columns; ++column)
      xray.values.at(column, row) *=
          1.0F / (1.0F + 9.0F / (1.0F + std::exp(static_cast<float>(kChestColumn - column))));
  const IrradiatedField field = field_of(xray);
  EXPECT_THAT(field.doubt, HasSubstr("leaves the isocenter out"));
  ASSERT_EQ(field.corners_px.size(), 4U);
  for (const Eigen::Vector2d& corner : field.corners_px)
    for (int axis = 0; axis < 2; ++axis) EXPECT_NEAR(std::abs(corner[axis] - 255.5), 256.0, 1e-6);
}

TEST(IrradiatedField, ABallInASmallFieldDoesNotHideIt) {
  CollimatedXray scene{.body = CollimatedXray::Body::kBall, .lower_mm = {-10, -10}, .upper_mm = {10, 10}};
  const XrayImage xray = xray_of(scene);
  const IrradiatedField field = field_of(xray);
  EXPECT_TRUE(field.is_sure()) << field.doubt;
  EXPECT_LT(field_error_mm(scene, xray.view, field.corners_px), 0.5);
  EXPECT_EQ(field_of(xray_of(opened(scene))).origin, Origin::kWholeReceptor);
}

// Jaws behind leaves: the leakage of the leaves ends where the jaws begin.
TEST(IrradiatedField, LeavesInsideOfJawsAreTheField) {
  CollimatedXray leaves{
      .body = CollimatedXray::Body::kThorax, .lower_mm = {-40, -30}, .upper_mm = {30, 50}, .scatter = 0.02};
  CollimatedXray jaws = leaves;
  jaws.lower_mm = {-80, -75};
  jaws.upper_mm = {70, 90};
  jaws.leakage = 0.0;
  XrayImage xray = xray_of(leaves);
  const XrayImage behind = xray_of(jaws);
  const double brightest = *std::ranges::max_element(behind.values.pixels);
  for (std::size_t n = 0; n < xray.values.pixels.size(); ++n)
    xray.values.pixels[n] *=
        static_cast<float>(0.02 + 0.98 * std::min(1.0, 50.0 * behind.values.pixels[n] / brightest));
  const IrradiatedField field = field_of(xray);
  EXPECT_TRUE(field.is_sure()) << field.doubt;
  EXPECT_LT(field_error_mm(leaves, xray.view, field.corners_px), 1.0);
}

// Jaws 5 mm behind leaves, whose light falls all the way to the jaws' edge, which the file declares: it is the longer
// edge and as clear, but the leaves' is the field's. Seeds that no constant was tuned on.
TEST(IrradiatedField, JawsJustBehindLeavesAreNotTheField) {
  int within = 0, wrong_and_sure = 0;
  for (std::uint64_t seed = 7101; seed <= 7140; ++seed) {
    CollimatedXray scene = random_collimated_xray(seed);
    scene.halo_share = 0.3;
    scene.collimator_deg = 0.0;
    scene.jaw_lower_mm = scene.lower_mm - Eigen::Vector2d(5, 5);
    scene.jaw_upper_mm = scene.upper_mm + Eigen::Vector2d(5, 5);
    XrayImage xray = xray_of(scene);
    xray.declared_aperture = aperture(xray, scene.jaw_lower_mm, scene.jaw_upper_mm);
    const IrradiatedField field = field_of(xray);
    const double error_mm = field_error_mm(scene, xray.view, field.corners_px);
    within += error_mm <= 1.0;
    if (field.is_sure() && error_mm > 1.0) ++wrong_and_sure;
    if (error_mm > 1.0) std::cout << "seed " << seed << ": " << error_mm << " mm; " << field.doubt << '\n';
  }
  std::cout << within << " of 40 within 1 mm\n";
  EXPECT_GE(within, 36);
  EXPECT_EQ(wrong_and_sure, 0);
}

// A side of which a third is seen: the rest lies behind something that lets nothing through.
TEST(IrradiatedField, AFaintSideIsNotSure) {
  CollimatedXray scene{.body = CollimatedXray::Body::kNone, .leakage = 0.0, .scatter = 0.1};
  XrayImage xray = xray_of(scene);
  for (int row = 140; row < 320; ++row)
    for (int column = 300; column < 512; ++column) xray.values.at(column, row) = 2500.0F;  // scatter alone
  const IrradiatedField field = field_of(xray);
  EXPECT_FALSE(field.is_sure());
  // A person's rectangle is the last word.
  FixedImage image = prepare(xray);
  EXPECT_FALSE(image.irradiated.is_sure());
  restrict_to({.first_column = 150, .first_row = 150, .last_column = 360, .last_row = 360}, image);
  EXPECT_TRUE(image.irradiated.is_sure());
  EXPECT_EQ(image.irradiated.origin, Origin::kDrawn);
  EXPECT_EQ(image.field.at(150, 150), 1);
  EXPECT_EQ(image.field.at(149, 150), 0);
  EXPECT_EQ(image.field.at(360, 360), 1);
}

TEST(IrradiatedField, DeclaredJawsThatTheImageShowsAreSure) {
  const CollimatedXray scene{.body = CollimatedXray::Body::kSkull, .lower_mm = {-50, -40}, .upper_mm = {60, 70}};
  XrayImage xray = xray_of(scene);
  xray.declared_aperture = aperture(xray, {-51, -40}, {60, 71});  // jaws are no better than that
  const IrradiatedField field = field_of(xray);
  EXPECT_EQ(field.origin, Origin::kDeclared);
  EXPECT_TRUE(field.is_sure()) << field.doubt;
  EXPECT_LT(field_error_mm(scene, xray.view, field.corners_px), 1.0);
}

TEST(IrradiatedField, DeclaredJawsThatTheImageContradictsAreNotSure) {
  const CollimatedXray scene{.body = CollimatedXray::Body::kSkull, .lower_mm = {-70, -70}, .upper_mm = {70, 70}};
  for (CollimatedXray other : {scene, opened(scene)}) {
    XrayImage xray = xray_of(other);
    xray.declared_aperture = aperture(xray, {-30, -30}, {30, 30});
    EXPECT_THAT(field_of(xray).doubt, HasSubstr("the file declares a smaller aperture than the image shows"));
    // The planned beam's jaws, or those of an imager that has none, are a hint at most.
    xray.declared_aperture->is_of_exposure = false;
    EXPECT_TRUE(field_of(xray).is_sure());
  }
}

TEST(IrradiatedField, DeclaredJawsBeyondTheReceptorLeaveItOpen) {
  XrayImage xray = xray_of(opened({.body = CollimatedXray::Body::kSkull}));
  xray.declared_aperture = aperture(xray, {-200, -200}, {200, 200});
  const IrradiatedField field = field_of(xray);
  EXPECT_EQ(field.origin, Origin::kWholeReceptor);
  EXPECT_TRUE(field.is_sure()) << field.doubt;
}

// What leaves that make no rectangle leave of an open X-ray: `outline_mm` along the collimator's axes, moved by
// `shift_mm`.
XrayImage behind_leaves(XrayImage xray, const std::vector<Eigen::Vector2d>& outline_mm,
                        const Eigen::Vector2d& shift_mm) {
  const auto is_inside = [&](const Eigen::Vector2d& at_mm) {
    bool inside = false;
    for (std::size_t n = 0; n < outline_mm.size(); ++n) {
      const Eigen::Vector2d here = outline_mm[n] + shift_mm, next = outline_mm[(n + 1) % outline_mm.size()] + shift_mm;
      if ((here.y() > at_mm.y()) == (next.y() > at_mm.y())) continue;
      const double x = here.x() + (at_mm.y() - here.y()) / (next.y() - here.y()) * (next.x() - here.x());
      inside = inside != (x > at_mm.x());
    }
    return inside;
  };
  const double mm = 1.0 / pixels_per_mm(xray.view);
  for (int row = 0; row < xray.view.rows; ++row)
    for (int column = 0; column < xray.view.columns; ++column) {
      int open = 0;
      for (int n = 0; n < 49; ++n)  // a penumbra of 3 mm
        open += is_inside({(column - 0.5 * (xray.view.columns - 1)) * mm + 0.5 * (n % 7 - 3),
                           (0.5 * (xray.view.rows - 1) - row) * mm + 0.5 * (n / 7 - 3)});
      xray.values.at(column, row) *= static_cast<float>(0.015 + 0.985 * open / 49.0);
    }
  return xray;
}

// Leaves of 10 mm about a target.
const std::vector<Eigen::Vector2d> kLeafOutlineMm = {{-30, -40}, {-30, -20}, {-50, -20}, {-50, 10}, {-35, 10},
                                                     {-35, 40},  {10, 40},   {10, 20},   {45, 20},  {45, 0},
                                                     {60, 0},    {60, -20},  {20, -20},  {20, -40}};

TEST(IrradiatedField, DeclaredLeavesThatTheImageShowsAreTheField) {
  const XrayImage open = xray_of(opened({.body = CollimatedXray::Body::kSkull}));
  const Eigen::Vector2d shift_mm(1.0, -1.5);  // leaves are no better than that
  XrayImage xray = behind_leaves(open, kLeafOutlineMm, shift_mm);
  xray.declared_aperture = DeclaredAperture();
  for (const Eigen::Vector2d& corner : kLeafOutlineMm)
    xray.declared_aperture->corners_px.push_back(pixel_at(xray, corner.x(), corner.y()));
  const IrradiatedField field = field_of(xray);
  EXPECT_TRUE(field.is_sure()) << field.doubt;
  EXPECT_EQ(field.origin, Origin::kDeclared);
  ASSERT_EQ(field.corners_px.size(), kLeafOutlineMm.size());
  for (std::size_t n = 0; n < kLeafOutlineMm.size(); ++n) {
    const Eigen::Vector2d truth_mm = kLeafOutlineMm[n] + shift_mm;
    EXPECT_LT((field.corners_px[n] - pixel_at(xray, truth_mm.x(), truth_mm.y())).norm() / pixels_per_mm(xray.view),
              1.0);
  }
  // What is compared lies off the leaves: inside of a step, and not in the corner that it cuts off.
  const FixedImage image = prepare(xray);
  const auto is_compared = [&](double x_mm, double y_mm) {
    const Eigen::Vector2d at = pixel_at(xray, x_mm, y_mm);
    return image.field.at(static_cast<int>(at.x()), static_cast<int>(at.y())) == 1;
  };
  EXPECT_TRUE(is_compared(0, 0));
  EXPECT_TRUE(is_compared(5, 34));
  EXPECT_TRUE(is_compared(-45, 0));
  EXPECT_FALSE(is_compared(20, 34));
  EXPECT_FALSE(is_compared(-45, 25));
  EXPECT_FALSE(is_compared(-29, -35));  // in the penumbra
}

TEST(IrradiatedField, DeclaredLeavesThatTheImageDoesNotShowAreNotSure) {
  for (const bool is_open : {true, false}) {
    const CollimatedXray jaws{.body = CollimatedXray::Body::kSkull, .lower_mm = {-50, -40}, .upper_mm = {60, 40}};
    XrayImage xray = xray_of(is_open ? opened(jaws) : jaws);
    xray.declared_aperture = DeclaredAperture();
    for (const Eigen::Vector2d& corner : kLeafOutlineMm)
      xray.declared_aperture->corners_px.push_back(pixel_at(xray, corner.x(), corner.y()));
    EXPECT_FALSE(field_of(xray).is_sure());
    // Those of the planned beam need not have been there.
    xray.declared_aperture->is_of_exposure = false;
    EXPECT_TRUE(field_of(xray).is_sure()) << field_of(xray).doubt;
  }
}

// A display's units: values that grow with the attenuation, of unknown scale and offset.
TEST(IrradiatedField, DisplayedImagesShowTheirFieldToo) {
  const CollimatedXray scene{.body = CollimatedXray::Body::kSkull, .lower_mm = {-50, -40}, .upper_mm = {60, 70}};
  XrayImage xray = xray_of(scene);
  xray.meaning = XrayImage::Meaning::kLineIntegral;
  for (float& value : xray.values.pixels) value = 4000.0F - 300.0F * std::log(std::max(value, 4.0F));
  const IrradiatedField field = field_of(xray);
  EXPECT_TRUE(field.is_sure()) << field.doubt;
  EXPECT_LT(field_error_mm(scene, xray.view, field.corners_px), 1.0);
}

}  // namespace
}  // namespace isoshift::irradiated_field_test
