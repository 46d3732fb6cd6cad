// The scout of a plastic head, a real X-ray at a known pose (tests/real_data/README.md).

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/support/command.h"
#include "tests/support/real_data.h"

namespace isoshift::scout_test {
namespace {

using Json = nlohmann::json;

Json scout_of_head(std::vector<std::string> flags) {
  flags.insert(flags.begin(), {"scout", (real_data() / "head/CT").string(),
                               (real_data() / "scout/head-scout.dcm").string(), "--json"});
  return Json::parse(run_command(flags).out);
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

}  // namespace
}  // namespace isoshift::scout_test
