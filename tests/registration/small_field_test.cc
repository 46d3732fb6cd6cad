// Small fields of the treatment beam, as cones and stereotactic leaves make: no wider than their own penumbras and
// corners are long, within jaws that are wider. Written after the X-rays of tests/real_data/winston_lutz_test.cc.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "geometry/rotation.h"
#include "registration/preprocess/irradiated_field.h"
#include "registration/preprocess/preprocess.h"
#include "tests/support/collimated_xray.h"

namespace isoshift::small_field_test {
namespace {

using Origin = IrradiatedField::Origin;

IrradiatedField field_of(const XrayImage& xray) { return find_irradiated_field(xray, pixels_per_mm(xray.view)); }

// A pixel of `xray` for a point along the collimator's axes, mm to the right and up as displayed.
Eigen::Vector2d pixel_at(const XrayImage& xray, const Eigen::Vector2d& at_mm) {
  const Eigen::Vector2d turned = Eigen::Rotation2Dd(xray.collimator_angle_rad) * at_mm;
  const double scale = pixels_per_mm(xray.view);
  return {0.5 * (xray.view.columns - 1) + scale * turned.x(), 0.5 * (xray.view.rows - 1) - scale * turned.y()};
}

// A field with a ball in it, in the penumbra of the real ones, 5 mm within its jaws.
CollimatedXray small_scene(const Eigen::Vector2d& middle_mm, const Eigen::Vector2d& width_mm) {
  CollimatedXray scene{.body = CollimatedXray::Body::kBall,
                       .lower_mm = middle_mm - 0.5 * width_mm,
                       .upper_mm = middle_mm + 0.5 * width_mm,
                       .penumbra_mm = 1.5,
                       .leakage = 0.015,
                       .scatter = 0.05,
                       .halo_share = 0.35,
                       .beam = Beam::kMegavoltage};
  scene.jaw_lower_mm = scene.lower_mm - Eigen::Vector2d(5, 5);
  scene.jaw_upper_mm = scene.upper_mm + Eigen::Vector2d(5, 5);
  return scene;
}

// The X-ray of a scene whose file declares the jaws.
XrayImage declared(const CollimatedXray& scene) {
  XrayImage xray = xray_of(scene);
  const Eigen::Vector2d &lower = scene.jaw_lower_mm, &upper = scene.jaw_upper_mm;
  xray.declared_aperture =
      DeclaredAperture{.corners_px = {pixel_at(xray, lower), pixel_at(xray, {upper.x(), lower.y()}),
                                      pixel_at(xray, upper), pixel_at(xray, {lower.x(), upper.y()})}};
  return xray;
}

void expect_found(const CollimatedXray& scene, const XrayImage& xray) {
  const IrradiatedField field = field_of(xray);
  EXPECT_TRUE(field.is_sure()) << field.doubt;
  EXPECT_EQ(field.origin, Origin::kFound);
  EXPECT_LT(field_error_mm(scene, xray.view, field.corners_px), 1.0);
  EXPECT_GT(field.sigma_mm, 0.05);
  EXPECT_LT(field.sigma_mm, 0.5);
}

TEST(SmallField, ASquareWithinWiderJawsIsFound) {
  for (const double width_mm : {15.0, 18.0, 20.0, 25.0, 30.0}) {
    SCOPED_TRACE(width_mm);
    const CollimatedXray scene = small_scene({0, 0}, {width_mm, width_mm});
    expect_found(scene, declared(scene));
    expect_found(scene, xray_of(scene));  // without a word about jaws
  }
}

TEST(SmallField, ABroadPenumbraAndRoundedCornersDoNotHideIt) {
  for (const double penumbra_mm : {2.5, 4.0})
    for (const double width_mm : {15.0, 20.0, 30.0}) {
      SCOPED_TRACE(testing::Message() << width_mm << " mm, penumbra " << penumbra_mm << " mm");
      CollimatedXray scene = small_scene({1, -2}, {width_mm, width_mm});
      scene.penumbra_mm = penumbra_mm;
      expect_found(scene, declared(scene));
    }
}

// Wherever it lies, oblong and turned; with jaws 0 to 15 mm farther out on each side, whatever the leakage.
TEST(SmallField, FieldsOffTheAxisAreFound) {
  int n = 0;
  for (const Eigen::Vector2d& middle_mm : {Eigen::Vector2d(20, -35), {-3, 4}, {-60, 10}})
    for (const Eigen::Vector2d& width_mm : {Eigen::Vector2d(15, 30), {28, 17}, {20, 20}}) {
      SCOPED_TRACE(testing::Message() << middle_mm.transpose() << ", " << width_mm.transpose());
      CollimatedXray scene = small_scene(middle_mm, width_mm);
      scene.seed = static_cast<std::uint64_t>(++n);
      scene.jaw_lower_mm = scene.lower_mm - Eigen::Vector2d(4 + n, 15 - n);
      scene.jaw_upper_mm = scene.upper_mm + Eigen::Vector2d(15 - n, 4 + n);
      scene.collimator_deg = n % 3 == 0 ? 0.0 : 10.0 * n - 45.0;
      scene.leakage = 0.002 * n;
      scene.gain_slope = 0.01 * n;
      expect_found(scene, declared(scene));
    }
}

TEST(SmallField, AConeIsFoundAsACircle) {
  for (const double diameter_mm : {15.0, 20.0, 30.0})
    for (const double penumbra_mm : {1.5, 3.0}) {
      SCOPED_TRACE(testing::Message() << diameter_mm << " mm, penumbra " << penumbra_mm << " mm");
      const Eigen::Vector2d middle_mm(2, -1);
      CollimatedXray scene = small_scene(middle_mm, {diameter_mm, diameter_mm});
      scene.is_cone = true;
      scene.penumbra_mm = penumbra_mm;
      const XrayImage xray = declared(scene);
      const IrradiatedField field = field_of(xray);
      EXPECT_TRUE(field.is_sure()) << field.doubt;
      EXPECT_EQ(field.origin, Origin::kFound);
      ASSERT_GE(field.corners_px.size(), 16U);
      for (const Eigen::Vector2d& corner : field.corners_px)
        EXPECT_NEAR((corner - pixel_at(xray, middle_mm)).norm() / pixels_per_mm(xray.view), 0.5 * diameter_mm, 0.75);
      EXPECT_GT(field.sigma_mm, 0.05);
      EXPECT_LT(field.sigma_mm, 0.5);
      // What is compared lies within the circle, off its penumbra: not the corners of the square about it.
      const FixedImage image = prepare(xray);
      const auto is_compared = [&](double off_mm) {
        const Eigen::Vector2d at = pixel_at(xray, middle_mm + off_mm * Eigen::Vector2d(1, 1));
        return image.field.at(static_cast<int>(at.x()), static_cast<int>(at.y())) == 1;
      };
      EXPECT_TRUE(is_compared(0.0));
      EXPECT_FALSE(is_compared(0.5 * diameter_mm - 2.0));
    }
}

// Jaws as large as the field are the field, by the file's own word.
TEST(SmallField, JawsAloneAreDeclaredAndSeen) {
  CollimatedXray scene = small_scene({0, 0}, {20, 20});
  scene.jaw_lower_mm = scene.lower_mm;
  scene.jaw_upper_mm = scene.upper_mm;
  const XrayImage xray = declared(scene);
  const IrradiatedField field = field_of(xray);
  EXPECT_TRUE(field.is_sure()) << field.doubt;
  EXPECT_EQ(field.origin, Origin::kDeclared);
  EXPECT_LT(field_error_mm(scene, xray.view, field.corners_px), 1.0);
}

// A field larger than the jaws of which the file speaks: one of both is wrong.
TEST(SmallField, BeyondTheDeclaredJawsItIsNotSure) {
  const CollimatedXray scene = small_scene({0, 0}, {30, 30});
  XrayImage xray = declared(scene);
  for (Eigen::Vector2d& corner : xray.declared_aperture->corners_px)
    corner = pixel_at(xray, {0, 0}) + 0.4 * (corner - pixel_at(xray, {0, 0}));
  EXPECT_THAT(field_of(xray).doubt, testing::HasSubstr("the file declares a smaller aperture than the image shows"));
}

// What larger fields show of air, lung or bone is no small field, nor is an open receptor.
TEST(SmallField, LargeFieldsAreNoSmallOnes) {
  for (std::uint64_t seed = 1201; seed <= 1208; ++seed)
    for (const bool is_open : {false, true}) {
      CollimatedXray scene = random_collimated_xray(seed);
      if (is_open) scene = opened(scene);
      const IrradiatedField kilovoltage = field_of(xray_of(scene));
      scene.beam = Beam::kMegavoltage;
      const IrradiatedField megavoltage = field_of(xray_of(scene));
      EXPECT_EQ(megavoltage.corners_px, kilovoltage.corners_px) << "seed " << seed;
    }
}

}  // namespace
}  // namespace isoshift::small_field_test
