// A Spatial Registration object as an input: a start, a pose to draw, what a report shows.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "geometry/rotation.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"
#include "tests/support/testdata.h"
#include "workflow/register/truth.h"

namespace isoshift::registration_object_command_test {
namespace {

using testing::HasSubstr;
using Strings = std::vector<std::string>;

class RegistrationObjectCommandTest : public testing::Test {
 protected:
  RegistrationObjectCommandTest() {
    pose_.linear() =
        rotation_from_zxy({.z_rad = rad_from_deg(1.1), .x_rad = rad_from_deg(-0.7), .y_rad = rad_from_deg(0.4)});
    pose_.translation() = Eigen::Vector3d(2.1, -3.3, 1.7);
    nlohmann::json json = {{"set_by", "jdoe"}};
    for (int n = 0; n < 3; ++n) {
      json["setup_error"]["translation_mm"].push_back(pose_.translation()[n]);
      json["setup_error"]["rotation_matrix"].push_back(
          {pose_.linear()(n, 0), pose_.linear()(n, 1), pose_.linear()(n, 2)});
    }
    std::ofstream(path("pose.json")) << json;
  }

  std::string path(const std::string& name) const { return (study_.path().parent_path() / name).string(); }
  std::string object_in(const std::string& folder) const { return path(folder) + "/spatial_registration.dcm"; }
  CommandOutcome run(Strings words, const std::string& folder) const {
    words.insert(words.end(), {"-o", path(folder)});
    return run_command(words);
  }
  // The object of the pose.
  void write_object() const {
    ASSERT_EQ(
        run({"register", study_.path().string(), "--start", path("pose.json"), "--no-search", "--write-reg-for-review"},
            "set")
            .exit_status,
        3);
  }
  nlohmann::json result_in(const std::string& folder) const {
    std::ifstream file(path(folder) + "/result.json");
    return nlohmann::json::parse(file);
  }

  SmallStudy study_;
  Eigen::Isometry3d pose_ = Eigen::Isometry3d::Identity();
};

// REG, pose, DRR, registration, REG.
TEST_F(RegistrationObjectCommandTest, OnesOwnComesBackThroughDrrs) {
  write_object();
  ASSERT_EQ(run({"register", study_.path().string(), "--start", object_in("set"), "--no-search"}, "judged").exit_status,
            3);
  EXPECT_THAT(read_setup_error(path("judged/result.json")), PoseNear(pose_, 1e-6, 1e-6));

  ASSERT_EQ(run({"drr", study_.path().string(), "--setup-error", object_in("set"), "--dicom"}, "drrs").exit_status, 0);
  const CommandOutcome found = run({"register", study_.path().string(), "--image", path("drrs/drr1.dcm"), "--image",
                                    path("drrs/drr2.dcm"), "--allow", "drr=the way back"},
                                   "found");
  ASSERT_EQ(found.exit_status, 0) << found.out << found.err;
  const auto uncertainty = result_in("found")["uncertainty"];
  const auto largest = [&](const char* key) { return std::ranges::max(uncertainty[key].get<std::array<double, 3>>()); };
  ASSERT_EQ(
      run({"register", study_.path().string(), "--start", object_in("found"), "--no-search"}, "again").exit_status, 3);
  EXPECT_THAT(read_setup_error(path("again/result.json")),
              PoseNear(pose_, largest("translation_mm"), largest("rotation_deg")));
}

TEST_F(RegistrationObjectCommandTest, AReportShowsOneOverTheXrays) {
  write_object();
  const CommandOutcome outcome = run({"report", study_.path().string(), "--reg", object_in("set")}, "report");
  EXPECT_EQ(outcome.exit_status, 3) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("taken from spatial_registration.dcm, NOT SEARCHED"));
  EXPECT_THAT(read_setup_error(path("report/result.json")), PoseNear(pose_, 1e-6, 1e-6));
  EXPECT_TRUE(std::filesystem::exists(path("report/view1.png")));
}

TEST_F(RegistrationObjectCommandTest, InspectDescribesOne) {
  write_object();
  const CommandOutcome outcome = run_command({"inspect", object_in("set"), "--json"});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  const auto file = nlohmann::json::parse(outcome.out)["files"][0];
  EXPECT_EQ(file["type"], "Spatial Registration");
  EXPECT_NEAR(file["rotation_deg"].get<double>(), deg_from_rad(Eigen::AngleAxisd(pose_.linear()).angle()), 1e-9);
  EXPECT_EQ(file["origin_mm"].size(), 3U);
}

TEST_F(RegistrationObjectCommandTest, ItsMatrixComesBackAsAnItkTransform) {
  write_object();
  const Strings written = {"check", object_in("set"), "--tfm", path("m.tfm")};
  ASSERT_EQ(run_command(written).exit_status, 0);
  EXPECT_EQ(run_command(written).exit_status, 1);  // it is there already
  const Strings judged = {"register", study_.path().string(), "--no-search", "--start", path("m.tfm")};
  EXPECT_THAT(run(judged, "none").err, HasSubstr("m.tfm: does not say where the machine's isocenter lies"));
  Strings with_isocenter = judged;
  with_isocenter.insert(with_isocenter.end(), {"--source-isocenter", "0,0,0"});
  ASSERT_EQ(run(with_isocenter, "judged").exit_status, 3);
  EXPECT_THAT(read_setup_error(path("judged/result.json")), PoseNear(pose_, 1e-6, 1e-6));
}

TEST_F(RegistrationObjectCommandTest, AnIsocenterThatMeansNothingIsRefused) {
  write_object();
  const auto refused = [&](const Strings& start) {
    Strings words = {"register", study_.path().string(), "--source-isocenter", "10,20,30"};
    words.insert(words.end(), start.begin(), start.end());
    return run(words, "refused").exit_status;
  };
  EXPECT_EQ(refused({}), 2);
  EXPECT_EQ(refused({"--start", path("pose.json")}), 2);
  EXPECT_EQ(refused({"--start", object_in("set")}), 2);  // it begins at the isocenter, and says so
}

// The X-rays' frame does not begin at the isocenter, and they say where in it the isocenter lies.
TEST_F(RegistrationObjectCommandTest, AnIsocenterThatContradictsTheXraysIsRefused) {
  for (int view = 0; view < 2; ++view)
    edit(study_.image(view), [](DicomItem d) {
      d.put(DCM_FrameOfReferenceUID, "1.2.3.4.77");
      d.put(DCM_IsocenterPosition, "9\\-150\\-251");
    });
  write_object();
  const Strings judged = {"register", study_.path().string(), "--no-search", "--start", object_in("set")};
  ASSERT_EQ(run(judged, "judged").exit_status, 3);
  EXPECT_THAT(read_setup_error(path("judged/result.json")), PoseNear(pose_, 1e-6, 1e-6));
  EXPECT_THAT(result_in("judged")["warnings"].dump(), HasSubstr("by IsocenterPosition (300A,012C) of the X-rays"));
  Strings other = judged;
  other.insert(other.end(), {"--source-isocenter", "14,-146,-251"});
  const CommandOutcome outcome = run(other, "other");
  EXPECT_EQ(outcome.exit_status, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--source-isocenter 14,-146,-251 contradicts the X-rays, whose IsocenterPosition "
                                     "(300A,012C) in the same frame is (9, -150, -251) mm"));
}

TEST_F(RegistrationObjectCommandTest, AResultAboutAnotherCtIsNoStart) {
  ASSERT_EQ(run({"register", study_.path().string()}, "found").exit_status, 0);
  nlohmann::json result = result_in("found");
  result["references"]["ct_frame_of_reference"] = "1.2.3";
  std::ofstream(path("other.json")) << result;
  const CommandOutcome outcome = run({"register", study_.path().string(), "--start", path("other.json")}, "refused");
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("is about a CT in another frame of reference than the study's"));
}

TEST_F(RegistrationObjectCommandTest, OneOfAnotherCtOrPatientIsNoStart) {
  write_object();
  const auto refusal = [&](const std::function<void(DicomItem)>& change) {
    const std::string copy = path("copy.dcm");
    std::filesystem::copy_file(object_in("set"), copy, std::filesystem::copy_options::overwrite_existing);
    edit(copy, change);
    const CommandOutcome outcome = run({"register", study_.path().string(), "--start", copy}, "refused");
    EXPECT_EQ(outcome.exit_status, 1);
    EXPECT_FALSE(std::filesystem::exists(path("refused")));
    return outcome.err;
  };
  EXPECT_THAT(refusal([](DicomItem d) {
                d.put(DCM_FrameOfReferenceUID, "1.2.3");
                d.items(DCM_RegistrationSequence)[0].put(DCM_FrameOfReferenceUID, "1.2.3");
              }),
              HasSubstr("copy.dcm: registers the frame 1.2.3, and the CT has "));
  EXPECT_THAT(refusal([](DicomItem d) { d.put(DCM_PatientID, "OTHER"); }),
              HasSubstr("PatientID (0010,0020) differs from that of the CT"));
  EXPECT_THAT(refusal([](DicomItem d) { d.put(DCM_SOPClassUID, "1.2.840.10008.5.1.4.1.1.66.3"); }),
              HasSubstr("copy.dcm: is a Deformable Spatial Registration"));
}

}  // namespace
}  // namespace isoshift::registration_object_command_test
