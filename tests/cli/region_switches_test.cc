#include "cli/switches/region_switches.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isoshift::region_switches_test {
namespace {

using testing::ElementsAre;

TEST(RegionSwitches, TakeNamesAsTheyAre) {
  CLI::App app;
  RegionOptions options;
  std::string study;
  app.add_option("study", study);
  add_region_switches(app, options);
  app.parse(R"(--structure "[Target,Head]" --structure PTV --exclude "[a]" --body 3 --body 4 exported)");
  EXPECT_THAT(options.structures, ElementsAre("[Target,Head]", "PTV"));
  EXPECT_THAT(options.excluded, ElementsAre("[a]"));
  EXPECT_THAT(options.bodies, ElementsAre(3, 4));
  EXPECT_EQ(study, "exported");
}

}  // namespace
}  // namespace isoshift::region_switches_test
