// From phantom studies of every way to lie, to turn the couch and to turn the panel, to the shift: no sign may be
// wrong.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "geometry/patient_setup.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"
#include "workflow/register/truth.h"

namespace isoshift::patient_setups_test {
namespace {

struct Setup {
  std::string position = "HFS";
  double couch_deg = 0.0, receptor_deg = 0.0, ct_tilt_deg = 0.0;
};

std::ostream& operator<<(std::ostream& out, const Setup& setup) {
  return out << setup.position << ", couch " << setup.couch_deg << ", receptor " << setup.receptor_deg << ", CT tilt "
             << setup.ct_tilt_deg;
}

class PatientSetups : public testing::TestWithParam<Setup> {};

// Errors of 3 to 6 mm and 1.4 to 2.1 degrees: a wrong sign anywhere is far beyond the tolerance, which is what voxels
// of 2 x 2 x 3 mm and scatter leave.
TEST_P(PatientSetups, AreRegisteredWithTheRightSigns) {
  PhantomOptions options = small_phantom();
  options.placement.patient_position = GetParam().position;
  options.placement.couch_angle_deg = GetParam().couch_deg;
  options.receptor_angle_deg = GetParam().receptor_deg;
  options.ct_tilt_deg = GetParam().ct_tilt_deg;
  options.voxel_mm = 2.0;
  options.image_pixels = 192;
  const SmallStudy study(options);
  const CommandOutcome outcome = register_study(study, {"--write-reg-for-review"});
  ASSERT_THAT(outcome.exit_status, testing::AnyOf(0, 3)) << outcome.err;
  const Eigen::Isometry3d truth = read_setup_error(study.truth());
  EXPECT_THAT(read_setup_error(study.output() / "result.json"), PoseNear(truth, 0.5, 0.6));
  // What another program would apply.
  const CommandOutcome checked = run_command({"check", (study.output() / "spatial_registration.dcm").string()});
  EXPECT_EQ(checked.exit_status, 0) << checked.out << checked.err;
}

INSTANTIATE_TEST_SUITE_P(All, PatientSetups,
                         testing::Values(Setup{"HFS"}, Setup{"HFP", 20.0}, Setup{"FFS", -35.0, 10.0},
                                         Setup{"FFP", 0.0, -25.0}, Setup{"HFDR", 10.0, 90.0}, Setup{"HFDL", -10.0},
                                         Setup{"FFDR", 5.0, 180.0}, Setup{"FFDL", 0.0, 5.0},
                                         Setup{"HFS", 0.0, 0.0, 15.0}, Setup{"FFP", 15.0, 30.0, -12.0}));

// A patient who lies as planned on a couch that is pitched by 2 and rolled by -1.5 degrees, which no X-ray says.
TEST(PatientSetupsByHand, CouchPitchAndRollAreNoSetupErrorOnceSupplied) {
  PhantomOptions options = small_phantom();
  options.placement.rotation_deg = Eigen::Vector3d(2.0, -1.5, 0.0);
  options.voxel_mm = 2.0;
  options.image_pixels = 192;
  const SmallStudy study(options);
  for (const int n : {0, 1})
    edit(study.image(n), [](DicomItem d) {
      d.erase(DCM_TableTopPitchAngle);
      d.erase(DCM_TableTopRollAngle);
    });
  const CommandOutcome outcome =
      register_study(study, {"--couch-pitch", "2", "--couch-roll", "-1.5", "--write-reg-for-review"});
  ASSERT_THAT(outcome.exit_status, testing::AnyOf(0, 3)) << outcome.err;
  EXPECT_THAT(outcome.err, testing::Not(testing::HasSubstr("taken as 0")));
  Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
  moved.translation() = options.placement.translation_mm;
  EXPECT_THAT(read_setup_error(study.output() / "result.json"), PoseNear(moved, 0.5, 0.6));

  std::ifstream file(study.output() / "result.json");
  const auto result = nlohmann::json::parse(file);
  EXPECT_THAT(result["overrides"].dump(), testing::HasSubstr("supplied by --couch-pitch 2"));
  EXPECT_NEAR(result["couch_target_deg"]["pitch"].get<double>(), 2.0, 0.6);
  EXPECT_NEAR(result["couch_target_deg"]["roll"].get<double>(), -1.5, 0.6);
  const CommandOutcome checked =
      run_command({"check", (study.output() / "spatial_registration.dcm").string(), "--plan", study.plan().string(),
                   "--couch-pitch", "2", "--couch-roll", "-1.5", "--json"});
  ASSERT_EQ(checked.exit_status, 0) << checked.out << checked.err;
  const auto shift = nlohmann::json::parse(checked.out)["registrations"][0]["couch_shift"];
  for (const char* axis : {"lateral_mm", "longitudinal_mm", "vertical_mm", "yaw_deg", "pitch_deg", "roll_deg"})
    EXPECT_NEAR(shift[axis].get<double>(), result["couch_shift"][axis].get<double>(), 1e-6) << axis;
}

}  // namespace
}  // namespace isoshift::patient_setups_test
