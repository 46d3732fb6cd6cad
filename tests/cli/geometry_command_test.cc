// isoshift qa geometry, from X-rays of balls by a panel that does not lie where its files say.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/output_folder.h"
#include "cli/console.h"
#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::geometry_command_test {
namespace {

using testing::HasSubstr;
using Json = nlohmann::json;

class GeometryCommandTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = new TemporaryFolder;
    positions_ = "session,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg\n";
    add("monday", "-1,-40,3", "-1,0.5,0");
    add("tuesday", "2,-1,2", "0,0.5,-1");
    add("friday", "4,38,-5", "1,-1.5,2");
    write_text(path("positions.csv"), positions_);
  }
  static void TearDownTestSuite() { delete folder_; }

  // The same phantom every day; of the later days only the X-rays are kept.
  static void add(const std::string& day, const std::string& mm, const std::string& deg) {
    const CommandOutcome made = run_command({"phantom", "-o", path(day), "--anatomy", "balls", "--gantry-angles",
                                             "0,45,90,135,180,225,270,315", "--panel-shift", "1.5,-1.5", "--panel-turn",
                                             "0.3,-0.3,0.3", "--translation", mm, "--rotation", deg});
    ASSERT_EQ(made.exit_status, 0) << made.err;
    if (day != "monday")
      for (const char* rest : {"CT", "RTPLAN.dcm", "truth.json"})
        std::filesystem::remove_all(std::filesystem::path(path(day)) / rest);
    positions_ += fmt::format("{},{},{}\n", day, mm, deg);
  }

  static std::string path(const std::string& name) { return (*folder_ / name).string(); }
  static CommandOutcome run(std::vector<std::string> more) {
    more.insert(more.begin(), {"qa", "geometry", path("monday"), path("tuesday"), path("friday"), "--ct",
                               path("monday/CT"), "--plan", path("monday/RTPLAN.dcm")});
    return run_command(more);
  }

  static TemporaryFolder* folder_;
  static std::string positions_;
};

TemporaryFolder* GeometryCommandTest::folder_ = nullptr;
std::string GeometryCommandTest::positions_;

// Planted: 1.5 mm along both axes, 0.3 degrees about all. The phantom moved along the table between the days.
TEST_F(GeometryCommandTest, FindsAPlantedShiftRollAndTilt) {
  for (const char* known : {"--moves", "--positions"}) {
    const CommandOutcome outcome = run({"--json", known, path("positions.csv")});
    ASSERT_EQ(outcome.exit_status, kExitAccepted) << outcome.err;
    const Json json = Json::parse(outcome.out);
    const auto value = [&](const char* key) { return json["imagers"]["kV"][key]["value"].get<double>(); };
    EXPECT_NEAR(value("shift_x_mm"), 1.5, 0.2);
    EXPECT_NEAR(value("shift_y_mm"), -1.5, 0.2);
    EXPECT_NEAR(value("roll_deg"), 0.3, 0.1);
    EXPECT_NEAR(value("tilt_x_deg"), 0.3, 0.1);
    EXPECT_NEAR(value("tilt_y_deg"), -0.3, 0.1);
    for (const char* none : {"shift_x_cos_mm", "shift_x_sin_mm", "shift_y_cos_mm", "shift_y_sin_mm"})
      EXPECT_NEAR(value(none), 0.0, 0.2) << none;
    EXPECT_NEAR(value("distance_mm"), 0.0, 1.0);
    EXPECT_NEAR(json["sessions"]["friday"]["moved"]["rz_deg"].get<double>(), 2.0, 0.1);
  }
}

// Tilts about x act like other places of the balls along y, unless the phantom moves along y.
TEST_F(GeometryCommandTest, OfOneSessionTheMostIsFoundBesideItsPose) {
  const CommandOutcome outcome = run_command(
      {"qa", "geometry", path("tuesday"), "--ct", path("monday/CT"), "--plan", path("monday/RTPLAN.dcm"), "--json"});
  ASSERT_EQ(outcome.exit_status, kExitAccepted) << outcome.err;
  const Json json = Json::parse(outcome.out);
  const Json imager = json["imagers"]["kV"];
  EXPECT_NEAR(imager["shift_x_mm"]["value"].get<double>(), 1.5, 0.05);
  EXPECT_NEAR(imager["roll_deg"]["value"].get<double>(), 0.3, 0.02);
  EXPECT_FALSE(imager["tilt_x_deg"]["is_determined"].get<bool>());
  const Json pose = json["sessions"]["tuesday"]["setup_error"];
  EXPECT_NEAR(pose["y_mm"].get<double>(), -1.0, 0.4);
  EXPECT_NEAR(pose["rz_deg"].get<double>(), -1.0, 0.05);
}

// A single day from one side: nothing of the shifts can be told.
TEST_F(GeometryCommandTest, WhatIsNotDeterminedIsNamed) {
  std::filesystem::create_directories(path("one-view"));
  std::filesystem::copy_file(path("tuesday/RTIMAGE/KV_G000.dcm"), path("one-view/KV_G000.dcm"));
  const CommandOutcome outcome =
      run_command({"qa", "geometry", path("one-view"), "--ct", path("monday/CT"), "--plan", path("monday/RTPLAN.dcm")});
  EXPECT_EQ(outcome.exit_status, kExitAccepted) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("not determined:"));
  EXPECT_THAT(outcome.out, HasSubstr("acts like a shift along y"));
}

// Four patients, each seen once from all sides by the same panel. Their results tell its roll and its transverse shift.
TEST_F(GeometryCommandTest, PatientsTellRollAndTransverseShift) {
  for (const char* seed : {"11", "12", "13", "14"}) {
    const std::string study = path(std::string("patient") + seed);
    ASSERT_EQ(
        run_command({"phantom", "-o", study, "--seed", seed, "--voxel-mm", "2", "--image-pixels", "256",
                     "--gantry-angles", "0,90,180,270", "--panel-shift", "1.5,-1.5", "--panel-turn", "0.3,-0.3,0.3"})
            .exit_status,
        0);
    const CommandOutcome registered = run_command({"register", study, "-o", path(std::string("results/") + seed)});
    ASSERT_NE(registered.exit_status, kExitFailed) << registered.err;
  }
  const CommandOutcome outcome = run_command({"qa", "geometry", "--patients", path("results"), "--json"});
  ASSERT_EQ(outcome.exit_status, kExitAccepted) << outcome.err;
  const Json json = Json::parse(outcome.out);
  const Json imager = json["imagers"]["kV"];
  EXPECT_EQ(json["cts"], 4);
  EXPECT_NEAR(imager["shift_x_mm"]["value"].get<double>(), 1.5, 0.2) << imager;
  EXPECT_NEAR(imager["roll_deg"]["value"].get<double>(), 0.3, 0.1) << imager;
  for (const char* unknown : {"shift_y_mm", "distance_mm", "tilt_x_deg", "tilt_y_deg"})
    EXPECT_FALSE(imager[unknown]["is_determined"].get<bool>()) << unknown;
  // One of them says too little by itself, and twice as much by its copy is an error.
  const CommandOutcome one = run_command({"qa", "geometry", "--patients", path("results/11")});
  EXPECT_THAT(one.out, HasSubstr("kV saw 1 CT: nothing is determined by fewer than 4"));
  std::filesystem::copy(path("results/11"), path("results/copy"), std::filesystem::copy_options::recursive);
  EXPECT_THAT(run_command({"qa", "geometry", "--patients", path("results")}).err, HasSubstr("are of the same X-ray"));
  EXPECT_THAT(run_command({"qa", "geometry", "--patients", path("results"), path("monday")}).err,
              HasSubstr("or with --patients"));
  for (const std::vector<std::string>& of_phantoms : std::vector<std::vector<std::string>>{
           {"--moves", path("positions.csv")}, {"--ct", path("monday/CT")}, {"--couch-angle", "0"}}) {
    std::vector<std::string> words = {"qa", "geometry", "--patients", path("results")};
    words.insert(words.end(), of_phantoms.begin(), of_phantoms.end());
    const CommandOutcome refused = run_command(words);
    EXPECT_EQ(refused.exit_status, kExitUsage) << of_phantoms.front();
    EXPECT_THAT(refused.err, HasSubstr(of_phantoms.front()));
  }
}

// Moves with the wrong sign: the balls are not where they should be, and nothing is printed.
TEST_F(GeometryCommandTest, WrongMovesAreAnError) {
  write_text(path("wrong.csv"),
             "session,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg\nmonday,-1,-40,3,-1,0.5,0\ntuesday,-2,1,-2,0,0.5,-1\nfriday,-"
             "4,-38,5,1,-1.5,2\n");
  const CommandOutcome outcome = run({"--moves", path("wrong.csv")});
  EXPECT_EQ(outcome.exit_status, kExitFailed);
  EXPECT_THAT(outcome.err, HasSubstr("session "));
  EXPECT_THAT(outcome.err, HasSubstr("places at which the X-rays should show balls"));
}

TEST_F(GeometryCommandTest, MistakesAreNamed) {
  write_text(path("no-angles.csv"), "session,x_mm,y_mm,z_mm\nmonday,-1,-40,3\ntuesday,2,-1,2\nfriday,4,38,-5\n");
  EXPECT_THAT(run({"--moves", path("no-angles.csv")}).err, HasSubstr("has no columns rx_deg, ry_deg, rz_deg"));
  write_text(path("others.csv"), "session,x_mm,y_mm,z_mm,rx_deg,ry_deg,rz_deg\nmonday,0,0,0,0,0,0\n");
  EXPECT_THAT(run({"--positions", path("others.csv")}).err, HasSubstr("has no line for session"));
  EXPECT_THAT(run({"--positions", path("others.csv"), "--moves", path("others.csv")}).err,
              HasSubstr("give one of them"));
  const CommandOutcome head = run_command({"phantom", "-o", path("head"), "--voxel-mm", "3", "--image-pixels", "128"});
  ASSERT_EQ(head.exit_status, 0);
  const CommandOutcome no_balls = run_command({"qa", "geometry", path("head")});
  EXPECT_EQ(no_balls.exit_status, kExitFailed);
  EXPECT_THAT(no_balls.err, HasSubstr("balls"));
}

}  // namespace
}  // namespace isoshift::geometry_command_test
