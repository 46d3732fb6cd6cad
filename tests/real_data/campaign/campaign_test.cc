// The campaign's own geometry against closed forms: what it calls the truth must be what its X-rays show.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/real_data/campaign/case_files.h"
#include "tests/real_data/campaign/case_plan.h"
#include "tests/real_data/campaign/tissue.h"
#include "tests/support/pose_near.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::campaign::campaign_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kRadPerDeg = 3.14159265358979323846 / 180.0;

// Air, 2 mm voxels, 80 x 80 x 120 mm.
Patient empty_patient(const std::string& position) {
  Patient patient;
  patient.size = Eigen::Vector3i(41, 41, 61);
  patient.spacing_mm = Vector3d::Constant(2.0);
  patient.first_mm = Vector3d(-36.0, -46.0, -50.0);
  patient.hu.assign(static_cast<std::size_t>(patient.size.prod()), -1000);
  patient.position = position;
  patient.frame_of_reference_uid = "1.2.3";
  patient.identity.patient_id = "CAMPAIGN";
  patient.identity.study_instance_uid = "1.2.4";
  return patient;
}

void put_ball(Patient& patient, const Vector3d& at_mm) { put_metal(patient, at_mm, at_mm + Vector3d(0.01, 0, 0), 5.0); }

Vector2d shadow(const std::vector<float>& image) {
  double weights = 0.0;
  Vector2d sum = Vector2d::Zero();
  for (int row = 0; row < kPixels; ++row)
    for (int column = 0; column < kPixels; ++column) {
      const double absorbed =
          std::max(0.0, 1.0 - static_cast<double>(image[static_cast<std::size_t>(row * kPixels + column)]) - 0.02);
      weights += absorbed;
      sum += absorbed * Vector2d(column, row);
    }
  return sum / weights;
}

TEST(Campaign, DeformationAndItsWayBackAgree) {
  const Deformation deformation({{Vector3d(0, 5, 10), 1.0, 60.0, Vector3d::UnitX(), 8.0 * kRadPerDeg},
                                 {Vector3d(0, 5, -10), -1.0, 110.0, Vector3d::UnitY(), -6.0 * kRadPerDeg}},
                                {.amplitude_mm = Vector3d(0, -4, -12), .still_behind_mm = 0, .full_before_mm = -50});
  for (const Vector3d& point :
       {Vector3d(20, 30, 5), Vector3d(-60, -40, 90), Vector3d(50, 10, -80), Vector3d(0, -70, 0)})
    EXPECT_THAT(deformation.planned_of(deformation.deformed_of(point)), VectorNear(point, 1e-5));
}

TEST(Campaign, ABentPartTurnsByItsAngleAndTheTargetStays) {
  const Deformation deformation({{Vector3d(0, 5, 15), 1.0, 60.0, Vector3d::UnitX(), 7.0 * kRadPerDeg}}, {});
  EXPECT_TRUE(deformation.motion_near(Vector3d(3, 4, 5)).isApprox(Eigen::Isometry3d::Identity(), 1e-6));
  // Beyond the growth everything moves as one.
  const Eigen::Isometry3d at_90 = deformation.motion_near(Vector3d(0, 0, 90)),
                          at_110 = deformation.motion_near(Vector3d(30, 20, 110));
  EXPECT_NEAR(Eigen::AngleAxisd(at_90.linear()).angle() / kRadPerDeg, 7.0, 1e-3);
  EXPECT_THAT(Vector3d(at_90 * Vector3d(0, 0, 100)), VectorNear(Vector3d(at_110 * Vector3d(0, 0, 100)), 0.01));
  // To the front: patient y is the back.
  EXPECT_LT((at_90 * Vector3d(0, 5, 90)).y(), 5.0);
}

TEST(Campaign, BreathLeavesTheSpineAndMovesTheFrontWhole) {
  const Deformation deformation({},
                                {.amplitude_mm = Vector3d(0, -3, -10), .still_behind_mm = 40, .full_before_mm = -10});
  EXPECT_THAT(deformation.deformed_of(Vector3d(0, 60, 20)), VectorNear(Vector3d(0, 60, 20), 1e-6));
  EXPECT_THAT(deformation.deformed_of(Vector3d(0, -30, 20)), VectorNear(Vector3d(0, -33, 10), 1e-5));
}

// A ball 60 mm above the isocenter, in the part that bends: truth.json says where it is found in the room, a pinhole
// where its shadow falls.
TEST(Campaign, TruthOfALevelSaysWhereItIsSeen) {
  for (const char* position : {"HFS", "FFS"}) {
    Patient patient = empty_patient(position);
    CasePlan plan{.seed = 1000, .stratum = "bent", .anatomy = "head"};
    plan.setup.isocenter_patient_mm = Vector3d(4, -6, -10);
    plan.setup.translation_mm = Vector3d(5, -7, 9);
    plan.setup.rotation = Eigen::AngleAxisd(0.04, Vector3d(1, 2, -1).normalized()).toRotationMatrix();
    plan.bendings = {{Vector3d(0, 5, 5), 1.0, 70.0, Vector3d(1, 1, 0).normalized(), 8.0 * kRadPerDeg}};
    const Vector3d at = plan.setup.isocenter_patient_mm + Vector3d(0, 0, 60);
    put_ball(patient, at);
    plan.exposures[0] = {.gantry_deg = 0.0, .photons = 1e12, .scatter_share = 0.0, .blur_mm = 0.0};
    plan.exposures[1] = {.gantry_deg = 90.0, .photons = 1e12, .scatter_share = 0.0, .blur_mm = 0.0};
    const Deformation deformation(plan.bendings, plan.breath);
    std::mt19937_64 random(1);
    const std::vector<std::vector<float>> images = expose(patient, deformation, plan.setup, plan.exposures, random);
    TemporaryFolder folder;
    write_case(plan, patient, deformation, images, folder.path());
    const nlohmann::json truth = nlohmann::json::parse(std::ifstream(folder / "truth.json"));
    const nlohmann::json& level = truth["levels"].back();  // 60 mm; at 90 there is no CT
    ASSERT_NEAR(level["center_patient_mm"][2].get<double>(), at.z(), 1e-9);
    const Vector3d planned = std::string(position) == "HFS" ? Vector3d(0, 60, 0) : Vector3d(0, -60, 0);
    Vector3d found;
    for (int row = 0; row < 3; ++row) {
      found[row] = level["translation_mm"][row];
      for (int k = 0; k < 3; ++k) found[row] += level["rotation_matrix"][row][k].get<double>() * planned[k];
    }
    const double middle = 0.5 * (kPixels - 1), front = 1500.0 / (1000.0 - found.z()) / kPixelMm,
                 side = 1500.0 / (1000.0 - found.x()) / kPixelMm;
    // The ball is of whole voxels: a third of a pixel of the panel.
    EXPECT_THAT(shadow(images[0]), VectorNear(Vector2d(middle + front * found.x(), middle - front * found.y()), 0.35))
        << position;
    EXPECT_THAT(shadow(images[1]), VectorNear(Vector2d(middle - side * found.z(), middle - side * found.y()), 0.35))
        << position;
  }
}

TEST(Campaign, SameSeedSameCase) {
  for (std::uint64_t seed = 1000; seed < 1018; ++seed) {
    const CasePlan a = draw_case(seed, stratum_of(seed), anatomy_of(seed)),
                   b = draw_case(seed, stratum_of(seed), anatomy_of(seed));
    EXPECT_EQ(a.setup.translation_mm, b.setup.translation_mm);
    EXPECT_LE(a.setup.translation_mm.norm(), 15.0);
    EXPECT_EQ(a.disturbances, b.disturbances);
    EXPECT_EQ(a.disturbances.empty(), a.stratum == "undisturbed");
  }
}

TEST(Campaign, SeriesGoInSteps) {
  for (std::uint64_t seed = 2000; seed < 2026; ++seed) {
    const CasePlan plan = draw_case(seed, stratum_of(seed), anatomy_of(seed));
    EXPECT_EQ(plan.stratum + " of a " + plan.anatomy, "breathing of a chest");
    EXPECT_EQ(-plan.breath.amplitude_mm.z(), 2.0 + static_cast<double>(seed % 13));
  }
  for (std::uint64_t seed = 3000; seed < 3010; ++seed) {
    const CasePlan plan = draw_case(seed, stratum_of(seed), anatomy_of(seed));
    EXPECT_EQ(plan.anatomy, "chest");
    EXPECT_NEAR(std::abs(plan.setup.translation_mm.y()), 25.0, 9.0);
  }
}

}  // namespace
}  // namespace isoshift::campaign::campaign_test
