// Renderers chosen on the command line: all of them register, and a flag that a renderer does not have is refused.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/command.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"
#include "tests/support/temporary_folder.h"
#include "workflow/register/truth.h"

namespace isoshift::rendering_test {
namespace {

using testing::HasSubstr;
using Json = nlohmann::json;

TEST(RenderingFlags, WhatARendererDoesNotHaveIsRefused) {
  SmallStudy study;
  const std::vector<std::pair<std::vector<std::string>, std::string>> refused = {
      {{"--renderer", "cpu", "--wobble", "voxel"}, "--wobble works only with splatting, and the renderer is cpu"},
      {{"--renderer", "raycast-box", "--wobble-sigma", "1"}, "--wobble-sigma works only with splatting"},
      {{"--renderer", "cpu", "--wobble-seed", "2"}, "--wobble-seed works only with splatting"},
      {{"--renderer", "raycast-box", "--deposit", "bilinear"}, "--deposit works only with splatting"},
      {{"--renderer", "raycast-box", "--block-edge", "4"}, "--block-edge works only with raycast-cuberille"},
      {{"--renderer", "siddon", "--precision", "u8"},
       "--precision below f32 works only with renderers other than references"},
      {{"--renderer", "cpu", "--gl", "software"}, "--gl works only with renderers on OpenGL"},
      {{"--renderer", "cpu", "--device", "1"}, "--device works only with renderers on OpenGL"},
      {{"--device", "77"},
       "--device works only with renderers on OpenGL, and the renderer is cpu (no hardware OpenGL: "},
      {{"--window", "0,100"}, "--window works only with --attenuation windowed"},
      {{"--renderer", "splat", "--gl", "software", "--wobble-sigma", "-1"}, "--wobble-sigma -1: expected 0 mm or more"},
  };
  for (const auto& [flags, message] : refused) {
    const CommandOutcome outcome = register_study(study, flags);
    EXPECT_EQ(outcome.exit_status, 2) << message;
    EXPECT_THAT(outcome.err, HasSubstr(message));
    EXPECT_FALSE(std::filesystem::exists(study.output()));
  }
  EXPECT_EQ(register_study(study, {"--renderer", "raycast-cuberille", "--block-edge", "3"}).exit_status, 2);
}

TEST(RenderingFlags, WhyAutoIsTheCpuIsInTheResult) {
  SmallStudy study;
  const CommandOutcome outcome = register_study(study, {"--preset", "fast", "--json"});
  const Json result = Json::parse(outcome.out);
  if (result["renderer"] == "raycast") GTEST_SKIP() << "there is a GPU here";
  EXPECT_THAT(result["renderer_settings"]["chosen_because"].get<std::string>(), HasSubstr("no hardware OpenGL: "));
}

class EveryRenderer : public testing::TestWithParam<std::vector<std::string>> {};

TEST_P(EveryRenderer, RegistersAndSaysWhatItUsed) {
  SmallStudy study;
  std::vector<std::string> flags = GetParam();
  if (flags[1] != "cpu") flags.insert(flags.end(), {"--gl", "software"});
  flags.insert(flags.end(), {"--preset", "fast", "--json"});
  const CommandOutcome outcome = register_study(study, flags);
  ASSERT_THAT(outcome.exit_status, testing::AnyOf(3, 4)) << outcome.err;  // the preset alone asks for review
  const Json result = Json::parse(outcome.out);
  EXPECT_EQ(result["renderer"], flags[1]);
  if (flags[1].starts_with("splat")) {
    EXPECT_THAT(result["reasons"].dump(), HasSubstr(flags[1] + " are too noisy"));
  } else {
    // Voxels of 4 x 4 x 6 mm, and for the cuberilles steps at their faces.
    EXPECT_THAT(read_setup_error(study.output() / "result.json"), PoseNear(read_setup_error(study.truth()), 2.0, 2.0));
  }
  for (std::size_t n = 2; n + 1 < GetParam().size(); n += 2) {
    std::string name = flags[n].substr(2);
    std::ranges::replace(name, '-', '_');
    EXPECT_EQ(result["renderer_settings"][name], flags[n + 1]);
  }
  const Json& settings = result["renderer_settings"];
  EXPECT_THAT(settings, testing::Contains(flags[1] == "cpu" ? "u8" : "u16"));
  EXPECT_FALSE(settings.contains("chosen_because"));
  if (flags[1] != "raycast") return;
  EXPECT_THAT(settings["driver"].get<std::string>(), HasSubstr("Mesa"));
  EXPECT_THAT(settings["self_check"].get<std::string>(), testing::StartsWith("passed, line integrals within 0.0"));
  EXPECT_THAT(settings["compared_with_cpu"].get<std::string>(),
              testing::MatchesRegex("[45][0-9]+ rays within 0.*rms."));
}

INSTANTIATE_TEST_SUITE_P(
    Flags, EveryRenderer,
    testing::Values(std::vector<std::string>{"--renderer", "cpu", "--precision", "u8"},
                    std::vector<std::string>{"--renderer", "raycast"},
                    std::vector<std::string>{"--renderer", "raycast-box"},
                    std::vector<std::string>{"--renderer", "raycast-cuberille", "--block-edge", "4"},
                    std::vector<std::string>{"--renderer", "splat", "--wobble", "voxel"},
                    std::vector<std::string>{"--renderer", "splat-texture", "--wobble-seed", "7"},
                    std::vector<std::string>{"--renderer", "splat-buffers", "--deposit", "bilinear"}));

TEST(Bench, PrintsEveryRowOfTheTableAsJson) {
  // One pose of 27,000 and few pixels: what is looked at is the protocol, not the time.
  const CommandOutcome outcome = run_command({"bench", "drr", "--renderer", "cpu", "--renderer", "splat-buffers",
                                              "--gl", "software", "--every", "27000", "--pixels", "64", "--json"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const Json result = Json::parse(outcome.out);
  EXPECT_EQ(result["protocol"]["poses"], 1);
  EXPECT_EQ(result["protocol"]["pixels"], 64);
  ASSERT_EQ(result["tables"].size(), 4U);  // two volumes, two thresholds
  for (const Json& table : result["tables"]) {
    EXPECT_GT(table["share_above"], 0.005);
    EXPECT_LT(table["share_above"], 0.6);
    ASSERT_EQ(table["rows"].size(), 4U);
    for (const Json& row : table["rows"]) {
      EXPECT_GT(row["wall_ms"]["mean"], 0.0);
      EXPECT_EQ(row["poses"], 1);
    }
    // One pose along an axis of the volume: coarse pixels show the splatting's noise.
    EXPECT_LT(table["rows"][1]["rms_error"], 0.02) << table["rows"][1];
    EXPECT_LT(table["rows"][0]["rms_error"], 0.3) << table["rows"][0];
    EXPECT_GT(table["rows"][0]["rms_error"], table["rows"][1]["rms_error"]);
  }
  EXPECT_GT(result["tables"][0]["share_above"], result["tables"][1]["share_above"]);
}

class BenchCommandTest : public testing::Test {
 protected:
  CommandOutcome measured(const std::string& every = "27000", const std::string& pixels = "64") {
    return run_command(
        {"bench", "drr", "--renderer", "cpu", "-o", rows().string(), "--json", "--every", every, "--pixels", pixels});
  }
  std::filesystem::path rows() const { return folder_ / "rows"; }

  TemporaryFolder folder_;
};

TEST_F(BenchCommandTest, KeepsRowsAsTheyEndAndGoesOnWhereItWasStopped) {
  const CommandOutcome whole = measured();
  ASSERT_EQ(whole.exit_status, 0) << whole.err;
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(rows()))
    if (entry.path().filename() != "protocol.json") files.push_back(entry.path());
  EXPECT_EQ(files.size(), 12U);  // three methods in four cells
  const std::filesystem::path lost = rows() / "spine-phantom-20-hu-ours-cpu.json";
  ASSERT_TRUE(std::filesystem::remove(lost));
  const CommandOutcome again = measured();
  ASSERT_EQ(again.exit_status, 0) << again.err;
  EXPECT_TRUE(std::filesystem::exists(lost));
  // Times tell: what was there was not measured again.
  const Json before = Json::parse(whole.out), after = Json::parse(again.out);
  for (std::size_t cell = 0; cell < 4; ++cell)
    for (std::size_t row = 0; row < 3; ++row) {
      if (cell == 1 && row == 0) continue;
      EXPECT_EQ(after["tables"][cell]["rows"][row], before["tables"][cell]["rows"][row]);
    }
}

TEST_F(BenchCommandTest, RefusesRowsOfAnotherProtocol) {
  ASSERT_EQ(measured().exit_status, 0);
  const CommandOutcome fewer_pixels = measured("27000", "32");
  EXPECT_EQ(fewer_pixels.exit_status, 1);
  EXPECT_THAT(fewer_pixels.err, HasSubstr("holds rows of another protocol"));
  const CommandOutcome more_poses = measured("13500");
  EXPECT_EQ(more_poses.exit_status, 1);
  EXPECT_THAT(more_poses.err, HasSubstr("has every 27000th of the poses"));

  std::filesystem::create_directory(folder_ / "notes");
  std::ofstream(folder_ / "notes" / "diary.txt") << "mine";
  const CommandOutcome notes = run_command({"bench", "drr", "-o", (folder_ / "notes").string()});
  EXPECT_EQ(notes.exit_status, 1);
  EXPECT_THAT(notes.err, HasSubstr("exists and holds no rows of Table 1"));
}

TEST(Bench, RowsOfAnotherDeviceAreNotGoneOnWith) {
  TemporaryFolder folder;
  const auto measure = [&] {
    return run_command({"bench", "drr", "--renderer", "splat-buffers", "--gl", "software", "-o",
                        (folder / "rows").string(), "--every", "27000", "--pixels", "32"});
  };
  ASSERT_EQ(measure().exit_status, 0);
  const std::filesystem::path file =
      folder / "rows" / "spine-phantom-380-hu-wobbled-splatting-vertex-buffer-objects.json";
  Json kept;
  std::ifstream(file) >> kept;
  kept["row"]["device"] = "Another GPU";
  std::ofstream(file) << kept.dump();
  const CommandOutcome again = measure();
  EXPECT_EQ(again.exit_status, 1);
  EXPECT_THAT(again.err, HasSubstr("is of the device Another GPU, and others are of llvmpipe"));
}

TEST_F(BenchCommandTest, ACtWithNothingAboveAThresholdIsAnError) {
  const SmallStudy study;
  for (const auto& slice : std::filesystem::directory_iterator(study.path() / "CT"))
    edit(slice.path(), [](DicomItem d) { d.put(DCM_RescaleIntercept, "-9000"); });
  const CommandOutcome outcome = run_command({"bench", "drr", "--renderer", "cpu", "--every", "27000", "--pixels", "32",
                                              "--ct", (study.path() / "CT").string()});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("holds nothing above -460 HU"));
}

TEST(Bench, FiguresAreMade) {
  TemporaryFolder folder;
  const std::filesystem::path output = folder.path() / "figures";
  const CommandOutcome outcome = run_command({"bench", "figures", "-o", output.string(), "--gl", "software"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  for (const char* name : {"bounding_structures.png", "sparse_pixels.png", "renderers.png"})
    EXPECT_GT(std::filesystem::file_size(output / name), 20000U) << name;
}

}  // namespace
}  // namespace isoshift::rendering_test
