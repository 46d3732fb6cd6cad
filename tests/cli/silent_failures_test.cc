// What goes wrong silently elsewhere must not be possible here: one test each.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "drr/gl/context.h"
#include "io/objects/spatial_registration.h"
#include "setup/couch_shift.h"
#include "tests/support/command.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"

namespace isoshift::silent_failures_test {
namespace {

using testing::HasSubstr;

class SilentFailures : public testing::Test {
 protected:
  XrayView view() {
    Notes notes;
    return xray_view(read_rt_images(study_.image(0), notes).front(), Beam::kKilovoltage, notes);
  }

  SmallStudy study_;
};

TEST_F(SilentFailures, ARequestForAGpuWhereThereIsNoneIsAnError) {
  if (has_hardware_gl()) GTEST_SKIP() << "there is a GPU here";
  const CommandOutcome outcome = register_study(study_, {"--renderer", "raycast"});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err,
              HasSubstr("error: no hardware OpenGL: there is no GPU that EGL knows.\n"
                        "       Use --renderer cpu, which needs no OpenGL, or --gl software to run this one on "
                        "the CPU\n"));
  EXPECT_FALSE(std::filesystem::exists(study_.output()));
}

TEST_F(SilentFailures, AnAllZeroDrrIsAnError) {
  for (const char* renderer : {"cpu", "raycast"}) {
    std::vector<std::string> flags = {"--threshold-hu", "9000", "--renderer", renderer};
    if (flags.back() == "raycast") flags.insert(flags.end(), {"--gl", "software"});
    const CommandOutcome outcome = register_study(study_, flags);
    EXPECT_EQ(outcome.exit_status, 1);
    EXPECT_THAT(outcome.err, HasSubstr("the DRR is empty")) << renderer;
  }
}

TEST_F(SilentFailures, AReceptorTranslationIsNotIgnored) {
  const Eigen::Vector2d before = view().project(Eigen::Vector3d::Zero()).value();
  edit(study_.image(0), [](DicomItem d) { d.put(DCM_XRayImageReceptorTranslation, "8.54166\\0\\-500"); });
  // The panel moves two pixels of 4.27 mm toward +x, so the isocenter lies two columns further left on it.
  EXPECT_THAT(view().project(Eigen::Vector3d::Zero()).value(),
              VectorNear(Eigen::Vector2d(before - Eigen::Vector2d(2, 0)), 1e-3));
}

TEST_F(SilentFailures, AReceptorAngleIsNotIgnored) {
  edit(study_.image(0), [](DicomItem d) { d.put(DCM_XRayImageReceptorAngle, 90.0); });
  // The receptor turns counter-clockwise seen from the source: what lay at its right (+x) now lies below (image rows
  // grow downward), since the receptor's own x axis points where its y axis did.
  const Eigen::Vector2d pixel = view().project(Eigen::Vector3d(20, 0, 0)).value();
  EXPECT_NEAR(pixel.x(), 47.5, 1e-6);
  EXPECT_NEAR(pixel.y(), 47.5 + 30.0 / (410.0 / 96), 1e-6);
}

TEST_F(SilentFailures, DegreesAreNotTakenForRadians) {
  edit(study_.image(0), [](DicomItem d) { d.put(DCM_GantryAngle, 90.0); });
  EXPECT_THAT(view().source_room_mm, VectorNear(Eigen::Vector3d(1000, 0, 0), 1e-9));
  // And back: a quarter turn is said to be 90.
  EXPECT_DOUBLE_EQ(deg_from_rad(zxy_from_rotation(rotation_z(rad_from_deg(90.0))).z_rad), 90.0);
}

TEST_F(SilentFailures, TheRegistrationObjectGivesThePoseOnTheWayBackAndNotItsInverse) {
  Notes notes;
  StudyRequest request;
  request.parts.study = study_.path();
  const Study study = load_study(request, notes, {});
  Eigen::Isometry3d error = Eigen::Isometry3d::Identity();
  error.linear() = rotation_from_zxy({0.1, -0.05, 0.07});
  error.translation() = Eigen::Vector3d(12, -8, 6);
  const Eigen::Isometry3d actual = error * study.planned_room_from_patient;
  const std::filesystem::path path = study_.path() / "reg.dcm";
  write_spatial_registration(study, actual, {}, path, notes);

  // Read by us and applied: the pose is that of the room's axes seen through item 2's matrix.
  const Eigen::Isometry3d m = read_spatial_registration(path).items[1].registered_from_source;
  Eigen::Isometry3d room_from_treatment = Eigen::Isometry3d::Identity();
  room_from_treatment.linear() = study.planned_room_from_patient.linear();
  const auto error_by = [&](const Eigen::Isometry3d& ct_from_source) {
    return setup_error_from_poses(study.planned_room_from_patient, room_from_treatment * ct_from_source.inverse());
  };
  EXPECT_THAT(error_by(m), PoseNear(error, 1e-6, 1e-6));
  EXPECT_THAT(error_by(m.inverse()), testing::Not(PoseNear(error, 1.0, 1.0)));
}

TEST_F(SilentFailures, WhatCannotBePrintedIsAnError) {
  for (const std::string& words :
       {"inspect '" + study_.path().string() + "'", std::string("--version"), std::string("drr --help")}) {
    const CommandOutcome outcome = run_shell(fmt::format("({} {} >/dev/full)", ISOSHIFT_PROGRAM, words));
    EXPECT_EQ(outcome.exit_status, 1) << words;
    EXPECT_THAT(outcome.out, HasSubstr("error: standard output cannot be written to"));
  }
}

// Whoever reads may have enough of it, which is no error, and stop nothing that is being written.
TEST_F(SilentFailures, WhoClosesAPipeGetsAWholeResult) {
  const CommandOutcome outcome =
      run_shell(fmt::format("bash -c \"set -o pipefail; {} register '{}' -o '{}' 2>&1 | head -c 1\"", ISOSHIFT_PROGRAM,
                            study_.path().string(), study_.output().string()));
  EXPECT_EQ(outcome.exit_status, 141);
  EXPECT_TRUE(std::filesystem::exists(study_.output() / "result.json"));
}

TEST_F(SilentFailures, AClosedTerminalLeavesNoHalfResultBehind) {
  // Under nohup the signal would be ignored, here as by the program.
  const CommandOutcome outcome =
      run_shell(fmt::format("env --default-signal=HUP {} register '{}' -o '{}' >/dev/null 2>&1 & process=$!; "
                            "until ls -d '{}'.partial-* >/dev/null 2>&1 || ! kill -0 $process; do sleep 0.005; done; "
                            "kill -HUP $process; wait $process; echo status $?; ls '{}'",
                            ISOSHIFT_PROGRAM, study_.path().string(), study_.output().string(),
                            study_.output().string(), study_.output().parent_path().string()));
  EXPECT_EQ(outcome.out, "status 129\nstudy\n");
}

// Of the owner and of the group, however a library writes them; of fewer people where the user says so.
TEST_F(SilentFailures, AllThatIsWrittenHasOneMode) {
  const auto modes = [&](const std::string& mask) {
    return run_shell(
               fmt::format("umask {} && {} register '{}' -o '{}' --overwrite >/dev/null && find '{}' -printf '%m\\n' | "
                           "sort -u",
                           mask, ISOSHIFT_PROGRAM, study_.path().string(), study_.output().string(),
                           study_.output().string()))
        .out;
  };
  EXPECT_EQ(modes("022"), "640\n750\n");
  EXPECT_EQ(modes("077"), "600\n700\n");
}

TEST_F(SilentFailures, TwoDashesEndTheFlags) {
  std::filesystem::rename(study_.path(), study_.path().parent_path() / "-study");
  const CommandOutcome outcome = run_shell(
      fmt::format("cd '{}' && {} register -o out -- -study", study_.path().parent_path().string(), ISOSHIFT_PROGRAM));
  EXPECT_EQ(outcome.exit_status, 0) << outcome.out;
}

TEST_F(SilentFailures, PipesAndDevicesThatAreNamedAreRefused) {
  const std::filesystem::path pipe = study_.path().parent_path() / "pipe";
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  for (const std::string& path : {pipe.string(), std::string("/dev/zero")})
    for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
             {"inspect", path},
             {"register", study_.path().string(), "--start", path, "-o", study_.output().string()},
             {"register", study_.path().string(), "--machine", path, "-o", study_.output().string()},
             {"check", path}}) {
      const CommandOutcome outcome = run_command(words);
      EXPECT_EQ(outcome.exit_status, 1) << words[0];
      EXPECT_THAT(outcome.out + outcome.err, HasSubstr(path + ": is a pipe, a socket or a device, expected a file"))
          << words[0];
    }
}

TEST_F(SilentFailures, ADeviceThatCanBeNoneIsRefused) {
  for (const char* device : {"abc def", "0x0", "99999999999999999999"}) {
    const CommandOutcome outcome =
        register_study(study_, {"--gl", "software", "--renderer", "raycast", "--device", device});
    EXPECT_EQ(outcome.exit_status, 2) << device;
    EXPECT_THAT(outcome.err, HasSubstr("is neither a device's number nor a UUID")) << device;
  }
}

}  // namespace
}  // namespace isoshift::silent_failures_test
