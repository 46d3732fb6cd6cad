// Regions that a person names, as segmenters write them: flipped, turned, shifted. The target's bone is not in them.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>

#include "base/json_file.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"
#include "tests/support/testdata.h"
#include "workflow/register/truth.h"

namespace isoshift::chosen_region_test {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;
using testing::Not;

class ChosenRegion : public testing::Test {
 protected:
  ChosenRegion() { std::filesystem::copy_file(testdata("spine") / "RTSTRUCT.dcm", structures_); }

  // Every point of every contour.
  void move(const std::function<Vector3d(const Vector3d&)>& to) const {
    edit(structures_, [&](DicomItem d) {
      for (DicomItem& roi : d.items(DCM_ROIContourSequence))
        for (DicomItem& contour : roi.items(DCM_ContourSequence)) {
          std::vector<double> numbers = contour.numbers(DCM_ContourData);
          for (std::size_t n = 0; n < numbers.size(); n += 3) {
            const Vector3d moved = to(Vector3d(numbers.data() + n));
            std::copy_n(moved.data(), 3, numbers.data() + n);
          }
          contour.put(DCM_ContourData, std::span(std::as_const(numbers)));
        }
    });
  }
  nlohmann::json result_with(std::vector<std::string> more) const {
    more.insert(more.begin(), {"register", testdata("spine").string(), "--date", "2026-03-01", "--structures",
                               structures_.string(), "--target", "isocenter", "-o", output_.string(), "--overwrite"});
    const CommandOutcome outcome = run_command(more);
    EXPECT_TRUE(outcome.exit_status == 0 || outcome.exit_status == 3) << outcome.err;
    return read_json_file(output_ / "result.json").json;
  }

  TemporaryFolder folder_;
  const std::filesystem::path structures_ = folder_ / "RTSTRUCT.dcm", output_ = folder_ / "out";
};

// Loose contours of a head, which hold much air.
TEST_F(ChosenRegion, OneThatHoldsTheTargetIsAccepted) {
  const CommandOutcome outcome =
      run_command({"register", testdata("head").string(), "--structure", "Head", "-o", output_.string()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.out;
  EXPECT_THAT(read_setup_error(output_ / "result.json"),
              PoseNear(read_setup_error(testdata("head") / "truth.json"), 0.5, 0.5));
}

TEST_F(ChosenRegion, ContoursThatDoNotHoldTheTargetsBoneNeedAReview) {
  const double middle_mm =
      read_json_file(testdata("spine") / "truth.json").json["isocenter_patient_mm"][1].get<double>();
  const std::function<Vector3d(const Vector3d&)> kinds[] = {
      [&](const Vector3d& at) { return Vector3d(at.x(), 2.0 * (middle_mm - 60.0) - at.y(), at.z()); },  // flipped in y
      [](const Vector3d& at) { return Vector3d(at.x() + 70.0, at.y(), at.z()); },                       // shifted
  };
  for (const auto& kind : kinds) {
    std::filesystem::copy_file(testdata("spine") / "RTSTRUCT.dcm", structures_,
                               std::filesystem::copy_options::overwrite_existing);
    move(kind);
    const nlohmann::json result = result_with({"--structure", "Spine", "--margin", "15"});
    EXPECT_NE(result["verdict"], "accepted");
    EXPECT_THAT(result["reasons"].dump(), HasSubstr("of the bone within 20 mm of the target"));
    EXPECT_THAT(result["reasons"].dump(), HasSubstr("structure Spine (bone is"));
  }
}

TEST_F(ChosenRegion, ARectangleMustHoldTheTarget) {
  const nlohmann::json views = result_with({"--preset", "fast"})["views"];
  const int columns = views[0]["columns"], rows = views[0]["rows"];
  const std::string label = views[0]["label"];
  const auto reasons = [&](double left, double right) {
    return result_with({"--preset", "fast", "--rectangle",
                        fmt::format("{}={},{},{},{}", label, static_cast<int>(left * columns), rows / 8,
                                    static_cast<int>(right * columns), rows - rows / 8)})["reasons"]
        .dump();
  };
  EXPECT_THAT(reasons(0.1, 0.4), HasSubstr(fmt::format("the rectangle of {} does not hold the target", label)));
  EXPECT_THAT(reasons(0.1, 0.52), HasSubstr("from the target's center"));
  EXPECT_THAT(reasons(0.1, 0.9), Not(HasSubstr("the rectangle of")));
}

}  // namespace
}  // namespace isoshift::chosen_region_test
