#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/error.h"
#include "tests/support/temporary_folder.h"
#include "workflow/evaluate/compared_bodies.h"
#include "workflow/evaluate/evaluation_files.h"
#include "workflow/register/truth.h"

namespace isoshift::compared_bodies_test {
namespace {

using Eigen::Vector3d;

Eigen::Isometry3d moved_by(const Vector3d& mm) { return Eigen::Isometry3d(Eigen::Translation3d(mm)); }

TEST(EvaluatedBodies, ATargetHasTheTruthOfTheNearestBody) {
  const std::vector<BodyTruth> bodies = {{.center_patient_mm = {0, 0, 8}, .setup_error = moved_by({1, 0, 0})},
                                         {.center_patient_mm = {0, 0, 60}, .setup_error = moved_by({2, 0, 0})}};
  const auto x_at = [&](const Vector3d& point) {
    return truth_at(point, moved_by({9, 0, 0}), Vector3d(0, 0, 0), bodies).translation().x();
  };
  EXPECT_EQ(x_at({0, 0, 55}), 2.0);
  EXPECT_EQ(x_at({0, 0, 6}), 1.0);
  EXPECT_EQ(x_at({0, 0, 3}), 9.0) << "the isocenter is nearer";
  EXPECT_EQ(truth_at({0, 0, 55}, moved_by({9, 0, 0}), Vector3d::Zero(), {}).translation().x(), 9.0);
}

TEST(EvaluatedBodies, AreComparedWithTheNearestTruth) {
  // Head first, supine: (x, y, z) of the room is (x, z, -y) of the patient.
  Eigen::Isometry3d planned = Eigen::Isometry3d::Identity();
  planned.linear() << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  const std::vector<BodyTruth> truths = {{.center_patient_mm = {0, 0, 0}, .setup_error = moved_by({1, 2, 3})},
                                         {.center_patient_mm = {0, 0, 60}, .setup_error = moved_by({1, 5, 3})}};
  const std::vector<BodyMotion> found = {{.name = "here", .center_room_mm = {0, 4, 0}},
                                         {.name = "there",
                                          .center_room_mm = {0, 50, 3},
                                          .displacement_mm = {0, 2.5, 0},
                                          .sigma_mm = {0.1, 0.2, 0.3},
                                          .image_share = 0.9},
                                         {.name = "far", .center_room_mm = {0, 100, 0}}};
  const auto compared = compared_bodies(found, truths, moved_by({1, 2, 3}), planned);
  ASSERT_EQ(compared.size(), 2U) << "what lies more than 25 mm from a truth is left out";
  EXPECT_LT(compared[0].true_mm.norm(), 1e-12);
  EXPECT_EQ(compared[1].name, "there");
  EXPECT_TRUE(compared[1].is_determined);
  EXPECT_LT((compared[1].true_mm - Vector3d(0, 3, 0)).norm(), 1e-12);
  EXPECT_EQ(compared[1].found_mm, Vector3d(0, 2.5, 0));
  EXPECT_TRUE(compared_bodies(found, {}, moved_by({1, 2, 3}), planned).empty());
  // A target that is turned: what lies 50 mm above it is brought back along its own axes.
  Eigen::Isometry3d target = moved_by({1, 2, 3});
  target.linear() = Eigen::AngleAxisd(0.5 * std::numbers::pi, Vector3d::UnitZ()).toRotationMatrix();
  const auto turned = compared_bodies(std::span(found).subspan(1, 1), truths, target, planned);
  // Truth puts (0, 50, 3) at (1, 55, 6); less the target's translation (0, 53, 3), turned back (53, 0, 3).
  EXPECT_LT((turned.at(0).true_mm - Vector3d(53, -50, 0)).norm(), 1e-12);
}

class BodyFilesTest : public testing::Test {
 protected:
  std::string written(const std::string& text) {
    std::ofstream(folder_ / "truth.json") << text;
    return (folder_ / "truth.json").string();
  }
  TemporaryFolder folder_;
};

TEST_F(BodyFilesTest, TruthsAreBodiesOrLevelsOrNone) {
  const std::string motion =
      R"({"center_patient_mm": [1, 2, 3], "rotation_matrix": [[0, -1, 0], [1, 0, 0], [0, 0, 1]], "translation_mm": [4, 5, 6]})";
  for (const char* list : {"bodies", "levels"}) {
    const auto truths = read_body_truths(written(fmt::format(R"({{"{}": [{}]}})", list, motion)));
    ASSERT_EQ(truths.size(), 1U);
    EXPECT_EQ(truths[0].center_patient_mm, Vector3d(1, 2, 3));
    EXPECT_EQ(truths[0].setup_error * Vector3d(1, 0, 0), Vector3d(4, 6, 6));
  }
  EXPECT_TRUE(read_body_truths(written("{}")).empty());
  EXPECT_TRUE(read_body_truths(written(R"({"setup_error": {}, "bodies": [{"name": "of a result.json"}]})")).empty());
  EXPECT_THROW(read_body_truths(written(R"({"bodies": [{"name": "skull"}]})")), Error);
}

// A run whose line is missing was stopped: its bodies are made again with it.
TEST_F(BodyFilesTest, BodiesAreReadBackWithTheirRuns) {
  const nlohmann::ordered_json configuration = {{"success_by", "mTRE"}};
  const EvaluatedBody skull{.name = "skull",
                            .is_determined = true,
                            .found_mm = {0.1, -2, 3},
                            .true_mm = {0.5, 0, 1e-7},
                            .sigma_mm = {0.25, 0.5, 1}};
  {
    EvaluationFolder folder(folder_ / "evaluation", configuration);
    folder.append({.number = 3, .bodies = {skull}});
    std::ofstream(folder_ / "evaluation" / "bodies.csv", std::ios::app) << "4,skull,no,1,1,1,1,1,1,1,1,1\n";
  }
  EvaluationFolder folder(folder_ / "evaluation", configuration);
  ASSERT_EQ(folder.runs().size(), 1U);
  ASSERT_EQ(folder.runs()[0].bodies.size(), 1U);
  const EvaluatedBody& read = folder.runs()[0].bodies[0];
  EXPECT_EQ(read.name, "skull");
  EXPECT_TRUE(read.is_determined);
  EXPECT_EQ(read.found_mm, skull.found_mm);
  EXPECT_EQ(read.true_mm, skull.true_mm);
  EXPECT_EQ(read.sigma_mm, skull.sigma_mm);
  folder.append({.number = 4, .bodies = {skull}});
  EXPECT_EQ(EvaluationFolder(folder_ / "evaluation").runs()[1].bodies.size(), 1U);
  // Older evaluations do not have the file.
  std::filesystem::remove(folder_ / "evaluation" / "bodies.csv");
  EXPECT_TRUE(EvaluationFolder(folder_ / "evaluation").runs()[1].bodies.empty());
}

}  // namespace
}  // namespace isoshift::compared_bodies_test
