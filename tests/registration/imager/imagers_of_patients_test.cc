#include "registration/imager/imagers_of_patients.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "base/error.h"
#include "geometry/rotation.h"
#include "geometry/target_error.h"
#include "registration/preprocess/preprocess.h"
#include "tests/support/gantry_view.h"

namespace isoshift::imagers_of_patients_test {
namespace {

using testing::HasSubstr;
using Motion = Eigen::Matrix<double, 6, 1>;

// The motion by which points about the isocenter are seen where an imager with errors shows them, with 5 mm of noise
// along the rays, and what a registration would know of it: written without the code under test.
WantedMotion wanted_with(const XrayView& view, const ImagerModel& model, const ImagerErrors& errors, const Motion& pose,
                         std::mt19937_64& random) {
  const std::vector<Eigen::Vector3d> points = standard_targets_mm();
  Eigen::MatrixXd lines(2 * points.size(), 6);
  Eigen::VectorXd off(2 * points.size());
  for (std::size_t n = 0; n < points.size(); ++n) {
    const Eigen::Vector2d here = view.project(points[n]).value();
    for (int axis = 0; axis < 6; ++axis) {
      const Eigen::Vector3d unit = Eigen::Vector3d::Unit(axis % 3);
      const Eigen::Vector3d moved = points[n] + 1e-4 * (axis < 3 ? unit : Eigen::Vector3d(unit.cross(points[n])));
      lines.block<2, 1>(static_cast<Eigen::Index>(2 * n), axis) = (view.project(moved).value() - here) / 1e-4;
    }
    off.segment<2>(static_cast<Eigen::Index>(2 * n)) = model.pixel_of(points[n], errors) - here;
  }
  // Of gradient correlation the points are few and certain to 0.3 mm; the noise is that of the normal equations.
  const double pixel_sigma = 0.3 * pixels_per_mm(view);
  const Eigen::Matrix<double, 6, 6> information = lines.transpose() * lines / (pixel_sigma * pixel_sigma);
  const Eigen::Matrix<double, 6, 6> covariance = information.inverse();
  std::normal_distribution<double> normal;
  Motion noise;
  for (double& value : noise) value = normal(random);
  return {.motion = covariance * (lines.transpose() * off / (pixel_sigma * pixel_sigma)) + pose +
                    covariance.llt().matrixL() * noise,
          .covariance = covariance};
}

std::vector<PatientSession> sessions_with(const ImagerErrors& errors, const std::vector<std::vector<double>>& angles,
                                          std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> off(-0.5, 0.5);
  std::vector<PatientSession> sessions;
  for (std::size_t n = 0; n < count; ++n) {
    PatientSession session{.ct = std::to_string(n % 6), .views = {}};
    Motion pose = Motion::Zero();
    for (int axis = 0; axis < 6; ++axis) pose[axis] = axis < 3 ? off(random) : 0.01 * off(random);
    for (const double gantry_deg : angles[n % angles.size()]) {
      const XrayView view = view_from_gantry(gantry_deg);
      const ImagerModel model(view, rad_from_deg(gantry_deg), kGantryViewSidMm);
      session.views.push_back({.model = model, .wanted = wanted_with(view, model, errors, pose, random)});
    }
    sessions.push_back(std::move(session));
  }
  return sessions;
}

ImagerEstimate::Parameter parameter_of(const ImagersOfPatients& found, ImagerParameter parameter) {
  return found.imagers.front().parameters[static_cast<std::size_t>(parameter)];
}

ImagerErrors planted() {
  ImagerErrors errors{};
  errors[static_cast<std::size_t>(ImagerParameter::kShiftX)] = 1.5;
  errors[static_cast<std::size_t>(ImagerParameter::kShiftY)] = -1.5;
  errors[static_cast<std::size_t>(ImagerParameter::kRoll)] = rad_from_deg(0.3);
  return errors;
}

// Two perpendicular views tell a roll, and of the shifts nothing: both are motions of the patient.
TEST(ImagersOfPatients, PairsTellRollAndNoShift) {
  const auto sessions = sessions_with(planted(), {{0.0, 90.0}}, 40, 1);
  const ImagersOfPatients found = imagers_of_patients(sessions, 1);
  const ImagerEstimate::Parameter roll = parameter_of(found, ImagerParameter::kRoll);
  EXPECT_TRUE(roll.is_determined);
  EXPECT_NEAR(deg_from_rad(roll.value), 0.3, 0.05);
  for (const ImagerParameter none : {ImagerParameter::kShiftX, ImagerParameter::kShiftY, ImagerParameter::kShiftYCos,
                                     ImagerParameter::kTiltX, ImagerParameter::kTiltY})
    EXPECT_FALSE(parameter_of(found, none).is_determined);
  EXPECT_NEAR(found.misfit, 1.0, 0.15);
}

// Opposed views tell the transverse shift, too; one along the table is the patient's in every view.
TEST(ImagersOfPatients, OpposedViewsTellTheTransverseShift) {
  const auto sessions = sessions_with(planted(), {{0.0, 90.0, 180.0, 270.0}}, 40, 2);
  const ImagersOfPatients found = imagers_of_patients(sessions, 1);
  EXPECT_TRUE(parameter_of(found, ImagerParameter::kShiftX).is_determined);
  EXPECT_NEAR(parameter_of(found, ImagerParameter::kShiftX).value, 1.5, 0.1);
  EXPECT_NEAR(deg_from_rad(parameter_of(found, ImagerParameter::kRoll).value), 0.3, 0.05);
  EXPECT_FALSE(parameter_of(found, ImagerParameter::kShiftY).is_determined);
}

// Errors lie within their sigmas as often as they should.
TEST(ImagersOfPatients, SigmasHoldWhatTheySay) {
  int within = 0, of = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const auto sessions = sessions_with(planted(), {{0.0, 90.0}, {180.0, 270.0}, {0.0, 180.0}}, 24, seed);
    const ImagersOfPatients found = imagers_of_patients(sessions, 1);
    for (const ImagerParameter parameter : {ImagerParameter::kShiftX, ImagerParameter::kRoll}) {
      const ImagerEstimate::Parameter one = parameter_of(found, parameter);
      within += std::abs(one.value - planted()[static_cast<std::size_t>(parameter)]) <= 2.0 * one.sigma ? 1 : 0;
      ++of;
    }
  }
  EXPECT_GE(within, of * 9 / 10);
}

// Sessions of bent patients, whose views want what no imager does.
TEST(ImagersOfPatients, ABentPatientCountsLess) {
  auto sessions = sessions_with(planted(), {{0.0, 90.0}}, 40, 3);
  for (std::size_t n = 0; n < 4; ++n) sessions[n].views[0].wanted.motion[5] += rad_from_deg(4.0);
  EXPECT_NEAR(deg_from_rad(parameter_of(imagers_of_patients(sessions, 1), ImagerParameter::kRoll).value), 0.3, 0.06);
}

// Six CTs were seen by the first imager, three by the second.
TEST(ImagersOfPatients, EveryImagerNeedsCtsOfItsOwn) {
  auto sessions = sessions_with(planted(), {{0.0, 90.0, 180.0, 270.0}}, 40, 5);
  for (std::size_t n = 0; n < sessions.size(); ++n)
    if (n % 6 < 3)
      for (std::size_t view = 0; view < 2; ++view) sessions[n].views[view].imager = 1;
  const ImagersOfPatients found = imagers_of_patients(sessions, 2);
  EXPECT_THAT(found.cts, testing::ElementsAre(6U, 3U));
  const auto roll = static_cast<std::size_t>(ImagerParameter::kRoll);
  EXPECT_TRUE(found.imagers[0].parameters[roll].is_determined);
  for (const ImagerEstimate::Parameter& parameter : found.imagers[1].parameters) EXPECT_FALSE(parameter.is_determined);
}

// Of six CTs that pairs saw, one was also seen from all sides, which alone tells the transverse shift.
TEST(ImagersOfPatients, NoErrorIsToldByASingleCt) {
  auto sessions = sessions_with(planted(), {{0.0, 90.0}}, 36, 6);
  auto from_all_sides = sessions_with(planted(), {{0.0, 90.0, 180.0, 270.0}}, 12, 7);
  for (PatientSession& session : from_all_sides) session.ct = "0";
  sessions.insert(sessions.end(), from_all_sides.begin(), from_all_sides.end());
  const ImagersOfPatients found = imagers_of_patients(sessions, 1);
  EXPECT_TRUE(parameter_of(found, ImagerParameter::kRoll).is_determined);
  EXPECT_FALSE(parameter_of(found, ImagerParameter::kShiftX).is_determined);
}

TEST(ImagersOfPatients, SingleViewsTellNothing) {
  const auto sessions = sessions_with(planted(), {{0.0}}, 3, 4);
  EXPECT_THROW(
      {
        try {
          imagers_of_patients(sessions, 1);
        } catch (const Error& error) {
          EXPECT_THAT(error.what(), HasSubstr("no session has two views"));
          throw;
        }
      },
      Error);
}

}  // namespace
}  // namespace isoshift::imagers_of_patients_test
