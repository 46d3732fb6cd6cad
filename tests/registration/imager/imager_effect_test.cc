#include "registration/imager/imager_effect.h"

#include <gtest/gtest.h>

#include "geometry/rotation.h"
#include "geometry/target_error.h"
#include "tests/support/gantry_view.h"

namespace isoshift::imager_effect_test {
namespace {

ImagerInView view_with(double gantry_deg, std::size_t number, ImagerParameter parameter, double sigma) {
  const XrayView view = view_from_gantry(gantry_deg);
  ImagerInView in_view{.model = ImagerModel(view, rad_from_deg(gantry_deg), kGantryViewSidMm),
                       .pixels_per_mm = pixels_per_mm(view),
                       .imager = {.number = number}};
  in_view.imager.sigmas[static_cast<std::size_t>(parameter)] = sigma;
  return in_view;
}

Uncertainty of_pair(ImagerParameter parameter, double sigma, Dof dof = Dof::kRigid) {
  const std::vector views = {view_with(0.0, 0, parameter, sigma), view_with(90.0, 0, parameter, sigma)};
  return uncertainty_by_imagers(views, dof);
}

// 4 mm on a receptor 1500 mm from a source 1000 mm from the isocenter are 2.7 mm there. Longitudinally both views
// agree; transversely the view from above takes it for x, the lateral one for z.
TEST(ImagerEffect, FourMillimetersOfThePanelAreTwoPointSevenOfTheSetup) {
  for (const Dof dof : {Dof::kRigid, Dof::kTranslation}) {
    const Eigen::Vector3d along_y = of_pair(ImagerParameter::kShiftY, 4.0, dof).sigma_translation_mm();
    EXPECT_NEAR(along_y.y(), 2.667, 0.02);
    EXPECT_LT(along_y.x() + along_y.z(), 0.05);
    const Eigen::Vector3d across = of_pair(ImagerParameter::kShiftX, 4.0, dof).sigma_translation_mm();
    EXPECT_NEAR(across.x(), 2.667, 0.05);
    EXPECT_NEAR(across.z(), 2.667, 0.05);
    EXPECT_LT(across.y(), 0.05);
  }
}

// A roll turns the patient about the axes of both beams. The view along z sees all of a turn about z, as x^2 + y^2 of
// the points, and wants the roll; the lateral view sees of it what moves along y, as x^2, and wants no turn: together
// they want two thirds of the roll.
TEST(ImagerEffect, RollTurnsThePatient) {
  const Eigen::Vector3d turned = of_pair(ImagerParameter::kRoll, rad_from_deg(1.0)).sigma_rotation_rad();
  EXPECT_NEAR(deg_from_rad(turned.x()), 2.0 / 3.0, 0.01);
  EXPECT_NEAR(deg_from_rad(turned.z()), 2.0 / 3.0, 0.01);
  EXPECT_LT(deg_from_rad(turned.y()), 0.01);
}

// Two imagers err each for itself: half the variance of one that errs alike in both views.
TEST(ImagerEffect, ImagersAreIndependent) {
  const std::vector views = {view_with(0.0, 0, ImagerParameter::kShiftY, 4.0),
                             view_with(90.0, 1, ImagerParameter::kShiftY, 4.0)};
  EXPECT_NEAR(uncertainty_by_imagers(views, Dof::kTranslation).sigma_translation_mm().y(), 2.667 / std::sqrt(2.0),
              0.03);
}

}  // namespace
}  // namespace isoshift::imager_effect_test
