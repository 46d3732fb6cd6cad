// A phantom that breathes, followed.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>
#include <utility>

#include "base/graceful_end.h"
#include "tests/support/small_study.h"

namespace isoshift::track_command_test {
namespace {

using testing::HasSubstr;

// 40 moments of two imagers and a 4D CT of four phases: 20 s of one core, and too large for testdata/.
void make_breathing_study(const std::filesystem::path& folder) {
  const CommandOutcome made = run_command({"phantom", "-o", folder.string(), "--overwrite", "--anatomy", "thorax",
                                           "--breathing", "8", "--voxel-mm", "2", "--image-pixels", "192", "--phases",
                                           "4", "--translation", "1,-2,1", "--rotation", "0,0,0"});
  ASSERT_EQ(made.exit_status, 0) << made.err;
}

// ctest runs every test in a process of its own. It names a folder for one study of all, which BreathingStudy makes.
const char* shared_study() { return std::getenv("ISOSHIFT_BREATHING_STUDY"); }

TEST(BreathingStudy, IsMadeOnceForAllTests) {
  if (shared_study() == nullptr) GTEST_SKIP() << "every test suite makes its own outside of ctest";
  make_breathing_study(shared_study());
}

class TrackCommandTest : public testing::Test {
 protected:
  static constexpr int kMoments = 40;

  static void SetUpTestSuite() {
    if (shared_study() != nullptr) return;
    folder_ = new TemporaryFolder;
    make_breathing_study(study());
  }
  static void TearDownTestSuite() { delete folder_; }
  // No test changes it.
  static std::filesystem::path study() { return shared_study() != nullptr ? shared_study() : *folder_ / "study"; }

  // Runs track on the study, or on what else is named, and returns track.json.
  nlohmann::json track(const std::vector<std::string>& more, bool whole_study = true) {
    std::vector<std::string> arguments = {"track",       "-o",     output().string(), "--overwrite",
                                          "--structure", "Target", "--json"};
    if (whole_study) arguments.push_back(study().string());
    arguments.insert(arguments.end(), more.begin(), more.end());
    outcome_ = run_command(arguments);
    EXPECT_EQ(outcome_.exit_status, 0) << outcome_.err;
    return outcome_.exit_status == 0 ? nlohmann::json::parse(outcome_.out) : nlohmann::json();
  }
  static std::vector<std::string> parts() {
    return {"--ct",         (study() / "CT").string(),          "--plan", (study() / "RTPLAN.dcm").string(),
            "--structures", (study() / "RTSTRUCT.dcm").string()};
  }
  static std::filesystem::path xray(int imager, int moment) {
    return study() / "RTIMAGE" / fmt::format("KV_G{:03}_{:05}.dcm", imager, moment);
  }
  std::filesystem::path output() const { return own_ / "track"; }

  static TemporaryFolder* folder_;
  TemporaryFolder own_;
  CommandOutcome outcome_;
};
TemporaryFolder* TrackCommandTest::folder_ = nullptr;

TEST_F(TrackCommandTest, FollowsTheTargetAndPredictsIt) {
  const auto json = track({"--truth", (study() / "truth.csv").string(), "--predictor", "kalman", "--tolerance", "5"});
  EXPECT_EQ(json["frames"], kMoments);
  EXPECT_EQ(json["status"]["measured"], kMoments);
  const auto& errors = json["beside_truth"];
  EXPECT_LT(errors["measured"]["median_mm"], 0.6);  // voxels of 2 x 2 x 3 mm
  EXPECT_LT(errors["predicted"]["rmse_mm"].get<double>(), 0.9 * errors["hold_last"]["rmse_mm"].get<double>());
  EXPECT_FALSE(json["beam_holds_s"].empty());
  EXPECT_NEAR(json["predictor_warm_from_s"], 0.2, 1e-6);  // two measurements
  for (const char* name : {"trace.csv", "track.json", "trace.svg"})
    EXPECT_TRUE(std::filesystem::exists(output() / name));
  // Its trace is one for predict.
  EXPECT_EQ(run_command({"predict", (output() / "trace.csv").string(), "--train-s", "4", "--rate", "5"}).exit_status,
            0);
}

// Of another time, or of none.
TEST_F(TrackCommandTest, ATruthThatDoesNotTellIsNotCompared) {
  const std::filesystem::path truth = own_ / "truth.csv";
  std::ofstream(truth) << "t_s,x_mm,y_mm,z_mm\n1000,50,50,50\n1001,50,50,50\n";
  EXPECT_TRUE(track({"--truth", truth.string()})["beside_truth"]["measured"]["rmse_mm"].is_null());
  const auto run = [&](const std::string& folder) {
    return run_command({"track", study().string(), "-o", (own_ / folder).string(), "--truth", truth.string()});
  };
  EXPECT_THAT(run("again").out, HasSubstr("measured   beside the truth: not compared"));
  std::ofstream(truth) << "t_s,x_mm,y_mm,z_mm\n";
  EXPECT_THAT(run("none").err, HasSubstr("truth.csv: holds no"));
}

TEST_F(TrackCommandTest, ThePhasesOfThe4dCtTeachTheModel) {
  std::vector<std::string> more = {"--predictor", "model", "--phases"};
  for (int phase = 0; phase < 4; ++phase) more.push_back((study() / "PHASES" / fmt::format("{:02}", phase)).string());
  const auto json = track(more);
  EXPECT_EQ(json["predictor"], "model");
  EXPECT_TRUE(json["predictor_warm_from_s"].is_null());  // 8 s do not tell phase and period
  EXPECT_THAT(outcome_.out, HasSubstr("phases_mm"));
  const Eigen::Vector3d inhaled_mm(1.2, -12.0, 3.0);  // toward the feet and to the front
  for (const auto& [phase, share] : {std::pair(0, 0.0), std::pair(1, 0.25), std::pair(2, 1.0), std::pair(3, 0.25)})
    for (int axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(json["phases_mm"][phase][axis], share * inhaled_mm[axis], 0.5) << phase << ", " << axis;
  EXPECT_EQ(run_command({"track", study().string(), "-o", output().string(), "--phases", "x"}).exit_status, 2);
  EXPECT_EQ(run_command(
                {"track", study().string(), "-o", output().string(), "--predictor", "model", "--phases", "x", "y", "z"})
                .exit_status,
            2);
}

// One imager: its two axes as good, the third flagged and uncertain.
TEST_F(TrackCommandTest, OneImagerSeesTwoAxes) {
  std::vector<std::string> more = parts();
  more.insert(more.end(), {"--truth", (study() / "truth.csv").string(), "--image"});
  for (int n = 1; n <= kMoments; ++n) more.push_back(xray(0, n).string());
  const auto json = track(more, false);
  EXPECT_EQ(json["imagers"], 1);
  EXPECT_EQ(json["status"]["partly"], kMoments);
  EXPECT_LT(json["beside_truth"]["measured"]["median_mm"], 0.6);
  std::ifstream trace(output() / "trace.csv");
  std::string line;
  for (int n = 0; n < 30; ++n) std::getline(trace, line);
  const auto cell = [&](int column) {
    std::size_t at = 0;
    for (int n = 0; n < column; ++n) at = line.find(',', at) + 1;
    return std::stod(line.substr(at));
  };
  EXPECT_LT(cell(10), 1.0);   // sigma along x, which gantry 0 sees
  EXPECT_GT(cell(12), 20.0);  // and along z, which it does not
}

// Imagers that take turns: every X-ray is a moment of its own.
TEST_F(TrackCommandTest, ImagersMayTakeTurns) {
  std::vector<std::string> more = parts();
  more.insert(more.end(), {"--truth", (study() / "truth.csv").string(), "--predictor", "kalman", "--image"});
  for (int n = 1; n <= kMoments; ++n) more.push_back(xray(n % 2 == 0 ? 0 : 90, n).string());
  const auto json = track(more, false);
  EXPECT_EQ(json["imagers"], 2);
  EXPECT_EQ(json["status"]["partly"], kMoments);
  // The lateral X-rays look through 350 mm of body, and no second view helps them.
  EXPECT_LT(json["beside_truth"]["measured"]["median_mm"], 1.2);
}

// A folder that is being filled: late, repeated and broken files do not stop it.
TEST_F(TrackCommandTest, FollowsAFolderThatIsBeingFilled) {
  const std::filesystem::path incoming = own_ / "incoming";
  std::filesystem::create_directories(incoming);
  const auto send = [&](int moment, const std::string& as = "") {
    for (const int imager : {0, 90})
      std::filesystem::copy_file(xray(imager, moment), incoming / fmt::format("{}{}_{}.dcm", as, imager, moment));
  };
  send(1);
  std::jthread sender([&] {
    for (int moment = 2; moment <= 20; ++moment) {
      if (moment == 10) continue;
      std::this_thread::sleep_for(std::chrono::milliseconds(30));
      send(moment);
    }
    send(5, "again");
    for (const int imager : {0, 90}) {  // written in two parts
      std::ifstream whole(xray(imager, 21), std::ios::binary);
      const std::string bytes{std::istreambuf_iterator<char>(whole), {}};
      std::ofstream part(incoming / fmt::format("{}_21.dcm", imager), std::ios::binary);
      part << bytes.substr(0, bytes.size() / 2) << std::flush;
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
      part << bytes.substr(bytes.size() / 2);
    }
    std::ofstream(incoming / "broken.dcm") << "no DICOM";
    std::this_thread::sleep_for(std::chrono::seconds(4));
    send(10);  // too late
  });
  std::vector<std::string> more = parts();
  more.insert(more.end(), {"--follow", incoming.string(), "--idle", "6", "--predictor", "kalman"});
  const auto json = track(more, false);
  EXPECT_EQ(json["frames"], 20);
  EXPECT_EQ(json["status"]["measured"], 20);
  EXPECT_EQ(json["files"]["repeated"], 2);
  EXPECT_EQ(json["files"]["late"], 2);
  EXPECT_EQ(json["files"]["broken"], 1);
  EXPECT_THAT(outcome_.err, HasSubstr("broken.dcm"));
  EXPECT_THAT(outcome_.err, HasSubstr("left aside: it arrived after a later X-ray had been processed"));
  std::ifstream trace(output() / "trace.csv");
  const std::string rows{std::istreambuf_iterator<char>(trace), {}};
  EXPECT_THAT(rows, HasSubstr("\n1.8000,,,,,,,,,,,,,,,late\n1.8000,,,,,,,,,,,,,,,late\n2.0000,"));
}

TEST_F(TrackCommandTest, AFileThatIsNoXrayDoesNotKeepAFolderFromBeingFollowed) {
  const std::filesystem::path incoming = own_ / "incoming";
  std::filesystem::create_directories(incoming);
  std::ofstream(incoming / "broken.dcm") << "no DICOM";
  for (const int imager : {0, 90})
    for (const int moment : {1, 2})
      std::filesystem::copy_file(xray(imager, moment), incoming / fmt::format("{}_{}.dcm", imager, moment));
  std::vector<std::string> more = parts();
  more.insert(more.end(), {"--follow", incoming.string(), "--idle", "3"});
  const auto json = track(more, false);
  EXPECT_EQ(json["frames"], 2);
  EXPECT_EQ(json["files"]["broken"], 1);
  EXPECT_THAT(outcome_.err, HasSubstr("broken.dcm"));
}

// The second imager begins in the middle, and is one of megavoltage. Whoever ends the run has its results.
TEST_F(TrackCommandTest, AnImagerMayBeginLaterAndARunBeEnded) {
  const std::filesystem::path both = own_ / "both", incoming = own_ / "incoming";
  const CommandOutcome made = run_command({"phantom", "-o", both.string(), "--anatomy", "thorax", "--breathing", "2",
                                           "--voxel-mm", "2", "--image-pixels", "192", "--phases", "0", "--translation",
                                           "0,0,0", "--rotation", "0,0,0", "--mv-angles", "90"});
  ASSERT_EQ(made.exit_status, 0) << made.err;
  std::filesystem::create_directories(incoming);
  const auto send = [&](const std::string& name) {
    std::filesystem::copy_file(both / "RTIMAGE" / name, incoming / name);
  };
  send("KV_G000_00001.dcm");
  std::jthread sender([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    for (int moment = 2; moment <= 10; ++moment) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      send(fmt::format("KV_G000_{:05}.dcm", moment));
      if (moment > 4) send(fmt::format("KV_G090_{:05}.dcm", moment));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(1500));
    EXPECT_TRUE(ask_for_end());
  });
  const auto json = track({"--ct", (both / "CT").string(), "--plan", (both / "RTPLAN.dcm").string(), "--structures",
                           (both / "RTSTRUCT.dcm").string(), "--follow", incoming.string(), "--idle", "600"},
                          false);
  EXPECT_EQ(json["imagers"], 2);
  EXPECT_GE(json["status"]["measured"], 5);  // the last moments
  EXPECT_GE(json["status"]["partly"], 4);
  EXPECT_EQ(json["files"]["broken"], 0);
}

// Some moments of the study, in which the X-rays of `spoiled` show nothing.
class SpoiledTrackTest : public TrackCommandTest {
 protected:
  std::vector<std::string> moments(int count, const std::set<int>& spoiled) {
    std::vector<std::string> more = parts();
    more.insert(more.end(), {"--tolerance", "1", "--truth", (study() / "truth.csv").string(), "--image"});
    for (int n = 1; n <= count; ++n)
      for (const int imager : {0, 90}) {
        const std::filesystem::path copy = own_ / fmt::format("{}_{}.dcm", imager, n);
        std::filesystem::copy_file(xray(imager, n), copy);
        if (spoiled.contains(n))
          edit(copy, [](DicomItem d) {
            std::vector<std::uint16_t> noise(192 * 192);
            for (std::size_t i = 0; i < noise.size(); ++i) noise[i] = static_cast<std::uint16_t>(400 + (i * 7919) % 97);
            d.put_pixels(noise);
          });
        more.push_back(copy.string());
      }
    return more;
  }
};

TEST_F(SpoiledTrackTest, AMomentWithoutTheTargetIsBridged) {
  const auto json = track(moments(12, {9}), false);
  EXPECT_EQ(json["status"]["measured"], 11);
  EXPECT_EQ(json["status"]["bridged"], 1);
}

// What is no target sets no standard, and until one is found nothing is said to be known.
TEST_F(SpoiledTrackTest, ABadBeginningIsNotTakenForTheTarget) {
  const auto json = track(moments(12, {1, 2}), false);
  EXPECT_EQ(json["status"]["measured"], 10);
  EXPECT_EQ(json["status"]["bridged"], 2);
  EXPECT_LT(json["beside_truth"]["measured"]["median_mm"], 0.6);  // the first moment is still the beginning of time
  EXPECT_NEAR(json["beam_holds_s"][0][0], 0.3, 1e-6);             // unknown: the beam waits
  std::ifstream trace(output() / "trace.csv");
  std::string line;
  std::getline(trace, line);
  std::getline(trace, line);
  EXPECT_TRUE(line.starts_with("0.0000,,,,,,,,,,,,,")) << line;
}

TEST_F(SpoiledTrackTest, ATargetThatIsNeverFoundIsAnError) {
  std::vector<std::string> arguments = {"track", "-o", output().string(), "--structure", "Target"};
  const std::vector<std::string> more = moments(3, {1, 2, 3});
  arguments.insert(arguments.end(), more.begin(), more.end());
  const CommandOutcome outcome = run_command(arguments);
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("the target was not found in any of 3 moments"));
  EXPECT_FALSE(std::filesystem::exists(output()));
}

}  // namespace
}  // namespace isoshift::track_command_test
