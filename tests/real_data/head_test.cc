// The plastic head with known setup errors (data/README.md): DICOM nobody here wrote, X-rays by another program.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "cli/truth.h"
#include "drr/gl/context.h"
#include "drr/renderer.h"
#include "geometry/target_error.h"
#include "io/ct_series.h"
#include "io/study.h"
#include "tests/drr/test_views.h"
#include "tests/support/command.h"
#include "tests/support/pose_near.h"
#include "tests/support/real_data.h"
#include "tests/support/temporary_folder.h"

namespace isoshift {
namespace {

const std::filesystem::path kHead = real_data() / "head";

// Registers a case; `output` receives the result.
Eigen::Isometry3d registered(const std::string& name, const std::filesystem::path& output,
                             const std::vector<std::string>& more = {}) {
  std::vector<std::string> arguments = {"register", (kHead / name).string(), "--ct", (kHead / "CT").string(),
                                        "-o",       output.string()};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const CommandOutcome outcome = run_command(arguments);
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  return read_setup_error(output / "result.json");
}

// AP and lateral; oblique at couch 10 with shifted panels and three polarities; MV and kV.
class Head : public testing::TestWithParam<const char*> {};

TEST_P(Head, IsFoundByBothRenderersAtTheSamePose) {
  ISOSHIFT_NEED_REAL_DATA("head");
  TemporaryFolder folder;
  const Eigen::Isometry3d truth = read_setup_error(kHead / GetParam() / "truth.json");
  const Eigen::Isometry3d by_cpu = registered(GetParam(), folder / "cpu", {"--renderer", "cpu"});
  const Eigen::Isometry3d by_gl = registered(
      GetParam(), folder / "gl", {"--renderer", "raycast", "--gl", has_hardware_gl() ? "hardware" : "software"});
  EXPECT_LT(mean_target_registration_error_mm(by_cpu, truth, standard_targets_mm()), 0.2);
  EXPECT_LT(mean_target_registration_error_mm(by_gl, truth, standard_targets_mm()), 0.2);
  EXPECT_THAT(by_gl, PoseNear(by_cpu, 0.05, 0.05));
}

INSTANTIATE_TEST_SUITE_P(All, Head, testing::Values("head-kv-pair", "head-oblique", "head-kv-mv"),
                         [](const auto& param) {
                           std::string name = param.param;
                           std::ranges::replace(name, '-', '_');
                           return name;
                         });

TEST(HeadRegistration, ObjectMeansTheTruthToPydicomAndPassesDciodvfy) {
  ISOSHIFT_NEED_REAL_DATA("head/head-kv-pair");
  TemporaryFolder folder;
  registered("head-kv-pair", folder / "out");
  const CommandOutcome checked = run_shell(
      fmt::format("dciodvfy -new {0} | grep '^Error'; /usr/bin/python3 {1}/tests/io/check_registration.py {0} {2} 0.3",
                  (folder / "out" / "spatial_registration.dcm").string(), ISOSHIFT_SOURCE_DIR,
                  (kHead / "head-kv-pair" / "truth.json").string()));
  EXPECT_EQ(checked.exit_status, 0) << checked.out;
  EXPECT_THAT(checked.out, testing::Not(testing::HasSubstr("Error"))) << checked.out;
}

TEST(HeadRenderers, AreWithinHalfAPercentOfTheirOracle) {
  ISOSHIFT_NEED_REAL_DATA("head/CT");
  const StudyFiles files = scan_study({real_data() / "head" / "CT"});
  Notes notes;
  Volume<float> ct = read_ct_series(files.cts.front().files, {}, notes, {}).hu;
  EXPECT_EQ(ct.size, Eigen::Vector3i(512, 512, 140));
  // Put the isocenter of head-kv-pair at the origin, HFS axes.
  const Eigen::Isometry3d pose = planned_room_from_patient(PatientPosition::kHfs, {}, Eigen::Vector3d(0, 110, 770));
  for (const double gantry_deg : {0.0, 45.0}) {
    const XrayView view = centered_view(gantry_deg, 128, 3.0);
    const auto rendered = [&](RendererKind kind) {
      const auto renderer = make_renderer(kind, ct, {}, kBothBeams, {.gl = GlDevice::kSoftware});
      const RenderResult result = renderer->render(std::span(&view, 1), std::span(&pose, 1), PixelSet::all());
      const auto pixels = result.line_integrals(0, 0);
      return std::vector<float>(pixels.begin(), pixels.end());
    };
    const auto oracle = rendered(RendererKind::kTrilinear);
    const double error = relative_error(rendered(RendererKind::kCpu), oracle);
    const double gl_error = relative_error(rendered(RendererKind::kRaycast), oracle);
    const double oracles = relative_error(rendered(RendererKind::kSiddon), oracle);
    RecordProperty("cpu_against_trilinear", std::to_string(error));
    RecordProperty("siddon_against_trilinear", std::to_string(oracles));
    RecordProperty("raycast_against_trilinear", std::to_string(gl_error));
    EXPECT_LT(error, 0.005);
    EXPECT_LT(gl_error, 0.005);
    EXPECT_LT(oracles, 0.03);  // docs/algorithms.md, "Oracles": 2.2 %; the scanner's noise is interpolated away
  }
}

}  // namespace
}  // namespace isoshift
