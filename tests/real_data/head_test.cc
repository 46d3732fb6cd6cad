// The plastic head with known setup errors (tests/real_data/README.md): DICOM nobody here wrote, X-rays by another
// program.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "drr/gl/context.h"
#include "drr/renderer.h"
#include "drr/renderer_pyramid.h"
#include "geometry/target_error.h"
#include "io/dicom/ct_series.h"
#include "io/study/study.h"
#include "registration/presets.h"
#include "setup/couch_shift.h"
#include "tests/drr/test_views.h"
#include "tests/support/command.h"
#include "tests/support/pose_near.h"
#include "tests/support/real_data.h"
#include "tests/support/temporary_folder.h"
#include "workflow/register/truth.h"

namespace isoshift::head_test {
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
  const CommandOutcome checked = run_shell(fmt::format(
      "dciodvfy -new {0} | grep '^Error'; /usr/bin/python3 {1}/tests/io/objects/check_registration.py {0} {2} 0.3",
      (folder / "out" / "spatial_registration.dcm").string(), ISOSHIFT_SOURCE_DIR,
      (kHead / "head-kv-pair" / "truth.json").string()));
  EXPECT_EQ(checked.exit_status, 0) << checked.out;
  EXPECT_THAT(checked.out, testing::Not(testing::HasSubstr("Error"))) << checked.out;
}

// Ranks do not change with a monotone change of the X-ray's intensity, as long as it cuts off nothing.
TEST(HeadRegistration, RankCorrelationIsBlindToMonotoneChanges) {
  ISOSHIFT_NEED_REAL_DATA("head/head-kv-pair");
  Notes notes;
  StudyRequest request;
  request.parts = {.study = kHead / "head-kv-pair", .ct = {kHead / "CT"}, .images = {}, .plan = {}};
  const Study study = load_study(request, notes, {});
  const RendererPyramid renderers(RendererKind::kCpu, study.ct->hu, {}, kBothBeams);
  RegistrationOptions by_ranks = preset("paper");
  by_ranks.stages.front().pixel_fraction = 1.0;
  const auto found_with = [&](auto&& change) {
    std::vector<XrayImage> xrays = study.xrays;
    for (XrayImage& xray : xrays) {
      const auto [least, most] = std::ranges::minmax(xray.values.pixels);
      for (float& value : xray.values.pixels) value = most * static_cast<float>(change(value / most, least / most));
    }
    const auto result = register_views(renderers, prepared(xrays), study.planned_room_from_patient, by_ranks);
    return setup_error_from_poses(study.planned_room_from_patient, result.actual_room_from_patient);
  };
  const Eigen::Isometry3d as_is = found_with([](double share, double) { return share; });
  EXPECT_LT(mean_target_registration_error_mm(as_is, read_setup_error(kHead / "head-kv-pair" / "truth.json"),
                                              standard_targets_mm()),
            0.5);
  for (const double gamma : {0.5, 2.0})
    EXPECT_THAT(found_with([&](double share, double) { return std::pow(share, gamma); }), PoseNear(as_is, 0.1, 0.1))
        << gamma;
  EXPECT_THAT(found_with([](double share, double least) { return (share - least) / (1.0 - least); }),
              PoseNear(as_is, 0.1, 0.1));  // a display window as wide as the image
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
}  // namespace isoshift::head_test
