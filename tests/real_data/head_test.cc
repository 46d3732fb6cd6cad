// The plastic head with known setup errors (data/README.md): DICOM nobody here wrote, X-rays by another program.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cli/truth.h"
#include "drr/renderer.h"
#include "io/ct_series.h"
#include "io/study.h"
#include "tests/drr/test_views.h"
#include "tests/support/command.h"
#include "tests/support/real_data.h"
#include "tests/support/temporary_folder.h"

namespace isoshift {
namespace {

// Registers a case and returns its mean target registration error in mm.
double registered(const std::string& name, const std::filesystem::path& output) {
  const std::filesystem::path head = real_data() / "head";
  const CommandOutcome outcome =
      run_command({"register", (head / name).string(), "--ct", (head / "CT").string(), "-o", output.string()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  return mean_target_registration_error_mm(read_setup_error(output / "result.json"),
                                           read_setup_error(head / name / "truth.json"));
}

TEST(Head, KvPairIsFound) {
  ISOSHIFT_NEED_REAL_DATA("head/head-kv-pair");
  TemporaryFolder folder;
  EXPECT_LT(registered("head-kv-pair", folder / "out"), 0.2);
  const CommandOutcome registration = run_shell(
      fmt::format("dciodvfy -new {0} | grep '^Error'; /usr/bin/python3 {1}/tests/io/check_registration.py {0} {2} 0.3",
                  (folder / "out" / "spatial_registration.dcm").string(), ISOSHIFT_SOURCE_DIR,
                  (real_data() / "head/head-kv-pair/truth.json").string()));
  EXPECT_EQ(registration.exit_status, 0) << registration.out;
  EXPECT_THAT(registration.out, testing::Not(testing::HasSubstr("Error"))) << registration.out;
}

TEST(Head, ObliqueViewsAtCouch10WithShiftedPanelsAreFound) {
  ISOSHIFT_NEED_REAL_DATA("head/head-oblique");
  TemporaryFolder folder;
  EXPECT_LT(registered("head-oblique", folder / "out"), 0.2);
}

TEST(Head, RendererIsWithinHalfAPercentOfItsOracle) {
  ISOSHIFT_NEED_REAL_DATA("head/CT");
  const StudyFiles files = scan_study({real_data() / "head" / "CT"});
  Notes notes;
  Volume<float> ct = read_ct_series(files.ct_series.begin()->second, {}, notes, {}).hu;
  EXPECT_EQ(ct.size, Eigen::Vector3i(512, 512, 140));
  // Put the isocenter of head-kv-pair at the origin, HFS axes.
  const Eigen::Isometry3d pose = planned_room_from_patient(PatientPosition::kHfs, {}, Eigen::Vector3d(0, 110, 770));
  const XrayView view = centered_view(0, 128, 3.0);
  const auto rendered = [&](RendererKind kind) {
    const auto renderer = make_renderer(kind, ct, {}, kBothBeams);
    const RenderResult result = renderer->render(std::span(&view, 1), std::span(&pose, 1), PixelSet::all());
    const auto pixels = result.line_integrals(0, 0);
    return std::vector<float>(pixels.begin(), pixels.end());
  };
  const auto oracle = rendered(RendererKind::kTrilinear);
  const double error = relative_error(rendered(RendererKind::kCpu), oracle);
  const double oracles = relative_error(rendered(RendererKind::kSiddon), oracle);
  RecordProperty("cpu_against_trilinear", std::to_string(error));
  RecordProperty("siddon_against_trilinear", std::to_string(oracles));
  EXPECT_LT(error, 0.005);
  EXPECT_LT(oracles, 0.03);  // docs/algorithms.md, "Oracles": 2.2 %; the scanner's noise is interpolated away
}

}  // namespace
}  // namespace isoshift
