// Patients who bent or breathe in another way than in their CT (tests/real_data/README.md): the target is right
// although nobody names a structure.

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/command.h"
#include "tests/support/real_data.h"
#include "tests/support/temporary_folder.h"
#include "workflow/register/truth.h"

namespace isoshift::bent_test {
namespace {

class Bent : public testing::TestWithParam<const char*> {};

TEST_P(Bent, TheTargetIsRight) {
  ISOSHIFT_NEED_REAL_DATA(GetParam());
  const std::filesystem::path study = real_data() / GetParam();
  TemporaryFolder folder;
  const CommandOutcome outcome = run_command(
      {"register", study.string(), "--ct", (study.parent_path() / "CT").string(), "-o", (folder / "out").string()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  const Eigen::Isometry3d found = read_setup_error(folder / "out" / "result.json");
  const Eigen::Isometry3d truth = read_setup_error(study / "truth.json");
  // The target lies at the isocenter.
  for (int n = 0; n < 8; ++n) {
    const Eigen::Vector3d place = 7.5 * Eigen::Vector3d(2 * (n & 1) - 1, 2 * ((n >> 1) & 1) - 1, 2 * (n >> 2) - 1);
    EXPECT_LT((found * place - truth * place).norm(), 1.0);
  }
}

// A sphere that holds what has moved against the target: nobody may take the answer for the target's.
TEST(BentHead, ARegionThatHoldsMoreThanTheTargetNeedsReview) {
  ISOSHIFT_NEED_REAL_DATA("head/head-bent");
  const std::filesystem::path study = real_data() / "head/head-bent";
  for (const char* radius_mm : {"87", "90", "95"}) {
    TemporaryFolder folder;
    const CommandOutcome outcome =
        run_command({"register", study.string(), "--ct", (study.parent_path() / "CT").string(), "-o",
                     (folder / "out").string(), "--around-isocenter", radius_mm});
    EXPECT_EQ(outcome.exit_status, 3) << radius_mm << " mm: " << outcome.err;
  }
}

INSTANTIATE_TEST_SUITE_P(All, Bent,
                         testing::Values("chest/chest-bent", "chest/chest-breathing", "chest/chest-breathing-5",
                                         "head/head-bent"),
                         [](const auto& param) {
                           std::string name = std::filesystem::path(param.param).filename();
                           std::ranges::replace(name, '-', '_');
                           return name;
                         });

}  // namespace
}  // namespace isoshift::bent_test
