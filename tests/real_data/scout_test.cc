// The scout of a plastic head, a real X-ray at a known pose (tests/real_data/README.md).

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/command.h"
#include "tests/support/real_data.h"
#include "tests/support/small_study.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::scout_test {
namespace {

using Json = nlohmann::json;

Json found_by(const std::filesystem::path& scout, std::vector<std::string> flags) {
  flags.insert(flags.begin(), {"qa", "scout", (real_data() / "head/CT").string(), scout.string(), "--json"});
  return Json::parse(run_command(flags).out);
}

Json scout_of_head(std::vector<std::string> flags) {
  return found_by(real_data() / "scout/head-scout.dcm", std::move(flags));
}

TEST(Scout, OfTheHeadIsWhereItsCtSays) {
  ISOSHIFT_NEED_REAL_DATA("scout");
  const Json found = scout_of_head({});
  EXPECT_EQ(found["verdict"], "accepted") << found["reasons"];
  EXPECT_EQ(found["tube"], "left");
  // Half a pixel and the table's way while it is scanned (docs/commands/scout.md).
  EXPECT_LT(std::abs(found["axes"]["posterior"]["offset_mm"].get<double>()), 0.6);
  EXPECT_LT(std::abs(found["axes"]["superior"]["offset_mm"].get<double>()), 0.6);
  EXPECT_LT(std::abs(found["axes"]["about_left"]["offset_deg"].get<double>()), 0.5);
  for (const char* axis : {"posterior", "superior"}) EXPECT_LT(found["axes"][axis]["repeatability_mm"], 0.1) << axis;
  EXPECT_LT(found["axes"]["about_left"]["repeatability_deg"], 0.1);
  // What the documentation shows is what is found (tests/tables/scout.py).
  std::ifstream file(std::filesystem::path(ISOSHIFT_SOURCE_DIR) / "bench/results/scout/head.json");
  const Json documented = Json::parse(file);
  EXPECT_EQ(found["scout"]["sha256"], documented["scout"]["sha256"]);
  for (const char* axis : {"posterior", "superior"})
    EXPECT_NEAR(found["axes"][axis]["offset_mm"].get<double>(), documented["axes"][axis]["offset_mm"].get<double>(),
                0.02)
        << axis;
  EXPECT_NEAR(found["width"].get<double>(), documented["width"].get<double>(), 0.001);
}

TEST(Scout, IsTheSameByEveryRayCaster) {
  ISOSHIFT_NEED_REAL_DATA("scout");
  const Json cpu = scout_of_head({"--renderer", "cpu"}),
             raycast = scout_of_head({"--renderer", "raycast", "--gl", "software"});
  for (const char* axis : {"posterior", "superior"})
    EXPECT_NEAR(cpu["axes"][axis]["offset_mm"].get<double>(), raycast["axes"][axis]["offset_mm"].get<double>(), 0.05);
}

TEST(Scout, FromTheWrongSideIsNotAccepted) {
  ISOSHIFT_NEED_REAL_DATA("scout");
  EXPECT_NE(scout_of_head({"--tube", "right"})["verdict"], "accepted");
}

// The other direction of rows or columns, from the opposite edge: the same pixels, the other way about.
TEST(Scout, MirroredOrUpsideDownIsRejected) {
  ISOSHIFT_NEED_REAL_DATA("scout");
  const TemporaryFolder folder;
  const std::filesystem::path scout = folder / "scout.dcm";
  for (const bool is_mirrored : {true, false}) {
    std::filesystem::copy_file(real_data() / "scout/head-scout.dcm", scout,
                               std::filesystem::copy_options::overwrite_existing);
    edit(scout, [&](DicomItem d) {
      std::vector<double> position = d.required_numbers(DCM_ImagePositionPatient, 3);
      std::vector<double> orientation = d.required_numbers(DCM_ImageOrientationPatient, 6);
      const double pixel_mm = d.required_numbers(DCM_PixelSpacing, 2)[0];
      const auto count = d.required_number(is_mirrored ? DCM_Columns : DCM_Rows);
      for (std::size_t n = 0; n < 3; ++n) {
        double& direction = orientation[is_mirrored ? n : n + 3];
        position[n] += (count - 1.0) * pixel_mm * direction;
        direction = -direction;
      }
      d.put(DCM_ImagePositionPatient, position);
      d.put(DCM_ImageOrientationPatient, orientation);
    });
    EXPECT_EQ(found_by(scout, {})["verdict"], "rejected") << (is_mirrored ? "mirrored" : "upside down");
  }
}

}  // namespace
}  // namespace isoshift::scout_test
