// One test body over all renderers: phantoms whose line integrals are known in closed form, then properties that any
// renderer has, then each against the oracle of its own interpolation.

#include "drr/renderer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "drr/gl/context.h"
#include "geometry/rotation.h"
#include "phantom/shapes.h"
#include "tests/drr/test_views.h"
#include "tests/support/gpu.h"
#include "tests/support/pose_near.h"

namespace isoshift::renderer_test {

namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

// Attenuation of water in kV, 1/mm.
constexpr double kWater = 0.0205;

std::vector<float> rendered(Renderer& renderer, const XrayView& view, const Eigen::Isometry3d& pose) {
  const RenderResult result = renderer.render(std::span(&view, 1), std::span(&pose, 1), PixelSet::all());
  const auto pixels = result.line_integrals(0, 0);
  return {pixels.begin(), pixels.end()};
}

// What a test runs over: a kind and, where it uses OpenGL, on which.
struct Tested {
  RendererKind kind;
  GlDevice gl = GlDevice::kHardware;
};

std::string name_of(const Tested& tested) {
  std::string name(to_string(tested.kind));
  std::ranges::replace(name, '-', '_');
  if (uses_gl(tested.kind)) name += tested.gl == GlDevice::kHardware ? "_hardware" : "_software";
  return name;
}

void PrintTo(const Tested& tested, std::ostream* out) { *out << name_of(tested); }

std::vector<Tested> all_tested() {
  std::vector<Tested> all;
  for (const RendererKind kind : kRendererKinds) {
    if (uses_gl(kind)) all.push_back({kind, GlDevice::kSoftware});
    all.push_back({kind, GlDevice::kHardware});
  }
  return all;
}

class RendererTest : public testing::TestWithParam<Tested> {
 protected:
  void SetUp() override {
    if (uses_gl(GetParam().kind) && GetParam().gl == GlDevice::kHardware) ISOSHIFT_SKIP_WITHOUT_GPU();
  }
  std::unique_ptr<Renderer> make(const Volume<float>& ct, const AttenuationModel& model = {}) {
    return make_renderer(GetParam().kind, ct, model, kBothBeams, {.gl = GetParam().gl});
  }
  // Interpolating renderers smear an edge over one voxel; Siddon and splatting do not.
  RendererKind oracle_kind() const {
    return GetParam().kind == RendererKind::kSiddon || splats() ? RendererKind::kSiddon : RendererKind::kTrilinear;
  }
  // Rays at fixed steps, not exact and not plane by plane.
  bool steps() const { return uses_gl(GetParam().kind) && !splats(); }
  bool splats() const { return is_splatting(GetParam().kind); }

  // The line integral about a pixel. What splatting counts are voxels that fall into pixels: its noise is taken out by
  // averaging over `half` pixels to each side, where the image is flat enough for that.
  double value_at(const std::vector<float>& drr, int columns, int column, int row, int half) const {
    if (!splats()) return drr[static_cast<std::size_t>(row * columns + column)];
    double sum = 0.0;
    for (int r = row - half; r <= row + half; ++r)
      for (int c = column - half; c <= column + half; ++c) sum += drr[static_cast<std::size_t>(r * columns + c)];
    return sum / ((2 * half + 1) * (2 * half + 1));
  }
};

TEST_P(RendererTest, RayThroughUniformCubeIntegratesToPathLengthTimesAttenuation) {
  // 41 voxels of 2 mm, so that the central ray passes voxel centers: 82 mm of water.
  const Volume<float> cube = centered_volume(Vector3i::Constant(41), Vector3d::Constant(2.0), 0.0F);
  const auto renderer = make(cube);
  for (const double gantry_deg : {0.0, 90.0, 180.0, 270.0}) {
    const XrayView view = centered_view(gantry_deg, 33, 1.0);
    const auto drr = rendered(*renderer, view, Eigen::Isometry3d::Identity());
    // Splatting: some 3000 voxels fall into the 31 x 31 pixels, of which those along the rim fall in or out by chance.
    const double tolerance = splats() ? 0.02 * 82.0 * kWater : 1e-4;
    EXPECT_NEAR(value_at(drr, 33, 16, 16, 15), 82.0 * kWater, tolerance) << "gantry " << gantry_deg;
    // A ray 10 pixels off the axis runs inclined by tan = 10/1500 between the same two faces.
    EXPECT_NEAR(value_at(drr, 33, 26, 16, 6), 82.0 * kWater * std::hypot(1.0, 10.0 / 1500.0), splats() ? 0.1 : 1e-3)
        << "gantry " << gantry_deg;
  }
}

TEST_P(RendererTest, OneVoxelIntegratesToItsEdgeLength) {
  Volume<float> ct = centered_volume(Vector3i::Constant(21), Vector3d(1.5, 2.0, 3.0), -1000.0F);
  ct.at(10, 10, 10) = 0.0F;
  const auto renderer = make(ct);
  if (splats()) {
    // One voxel falls into one pixel, with all that it holds: mu dV in units of a pixel's area at the isocenter.
    const auto drr = rendered(*renderer, centered_view(0, 33, 1.0), Eigen::Isometry3d::Identity());
    const double pixel_area_mm2 = std::pow(1000.0 / 1500.0, 2);
    const double weight = 1.5 * 2.0 * 3.0 * kWater / pixel_area_mm2;
    EXPECT_EQ(std::ranges::count(drr, 0.0F), 33 * 33 - 1);
    EXPECT_NEAR(*std::ranges::max_element(drr), weight, 1e-5 * weight);
    return;
  }
  // The central ray meets the voxel's center along one of its axes: the interpolated tent has the voxel's own area. Two
  // or three midpoint samples of such a tent are off by up to a ninth; on a CT these errors average out.
  const double tolerance = steps() ? 0.12 : 1e-6;
  EXPECT_NEAR(rendered(*renderer, centered_view(0, 33, 1.0), Eigen::Isometry3d::Identity())[16 * 33 + 16], 3.0 * kWater,
              tolerance * 3.0 * kWater + 1e-7);
  EXPECT_NEAR(rendered(*renderer, centered_view(90, 33, 1.0), Eigen::Isometry3d::Identity())[16 * 33 + 16],
              1.5 * kWater, tolerance * 1.5 * kWater + 1e-7);
}

TEST_P(RendererTest, SphereHasTheChordsOfASphere) {
  const double radius_mm = 40.0;
  Volume<float> ct = centered_volume(Vector3i::Constant(101), Vector3d::Constant(1.0), -1000.0F);
  const Shape sphere =
      make_shape(Shape::Kind::kEllipsoid, Vector3d::Zero(), Vector3d::Constant(radius_mm), {.water = 1.0});
  ct = ct_of_shapes({sphere}, ct.size, ct.patient_from_voxel);
  const auto renderer = make(ct, {.threshold_hu = -1001});
  const XrayView view = centered_view(30, 65, 2.0);
  const auto drr = rendered(*renderer, view, Eigen::Isometry3d::Identity());
  for (const int column : {32, 40, 48}) {
    const Ray ray = view.ray(column, 30);
    const double chord_mm = sphere.chord_mm(ray.source_room_mm, ray.pixel_room_mm);
    // Partial volumes are sampled by 8 points: about 1 % of a voxel at each end.
    // Splatting: 49 pixels hold some 5 voxels per mm of depth.
    EXPECT_NEAR(value_at(drr, 65, column, 30, 3), chord_mm * kWater, (splats() ? 2.0 : 0.35) * kWater)
        << "column " << column;
  }
}

TEST_P(RendererTest, RaysThatMissTheVolumeAreZero) {
  const Volume<float> cube = centered_volume(Vector3i::Constant(10), Vector3d::Constant(2.0), 0.0F);
  const auto renderer = make(cube);
  const auto drr = rendered(*renderer, centered_view(0, 65, 2.0), Eigen::Isometry3d::Identity());
  EXPECT_EQ(drr.front(), 0.0F);
  EXPECT_EQ(drr.back(), 0.0F);
  EXPECT_GT(drr[32 * 65 + 32], 0.0F);
}

TEST_P(RendererTest, BatchEqualsSingles) {
  const Volume<float> ct = textured_volume();
  const auto renderer = make(ct);
  const std::vector<XrayView> views = {centered_view(0, 24, 6.0), centered_view(70, 33, 4.0)};
  const std::vector<Eigen::Isometry3d> poses = random_poses(3);
  std::vector<std::vector<float>> singles;
  for (const auto& pose : poses)
    for (const auto& view : views) singles.push_back(rendered(*renderer, view, pose));
  const RenderResult batch = renderer->render(views, poses, PixelSet::all());
  for (std::size_t p = 0; p < poses.size(); ++p)
    for (std::size_t v = 0; v < views.size(); ++v)
      EXPECT_THAT(batch.line_integrals(p, v), testing::ElementsAreArray(singles[p * views.size() + v]));
}

TEST_P(RendererTest, SparsePixelsEqualThoseOfTheWholeImage) {
  const Volume<float> ct = textured_volume();
  const auto renderer = make(ct);
  const XrayView view = centered_view(20, 40, 4.0);
  const Eigen::Isometry3d pose = random_poses(1).front();
  const auto whole = rendered(*renderer, view, pose);
  const PixelSet pixels{.of_view = {{0, 5, 820, 821, 1599}}};
  const RenderResult sparse = renderer->render(std::span(&view, 1), std::span(&pose, 1), pixels);
  // Rays in other company are counted from another plane: they differ by the rounding of floats.
  for (std::size_t n = 0; n < pixels.of_view[0].size(); ++n)
    EXPECT_NEAR(sparse.line_integrals(0, 0)[n], whole[pixels.of_view[0][n]], 1e-5);
}

TEST_P(RendererTest, RandomPixelsEqualThoseOfTheWholeImage) {
  const Volume<float> ct = textured_volume();
  const auto renderer = make(ct);
  const std::vector<XrayView> views = {centered_view(20, 61, 3.0), centered_view(110, 40, 4.0)};
  const Eigen::Isometry3d pose = random_poses(1).front();
  const PixelSet pixels = PixelSet::random(views, 0.05, 1);
  const RenderResult result = renderer->render(views, std::span(&pose, 1), pixels);
  const std::vector<float> sparse(result.line_integrals(0, 1).begin(), result.line_integrals(0, 1).end());
  EXPECT_EQ(sparse.size(), 80U);
  const auto whole = rendered(*renderer, views[1], pose);
  for (std::size_t n = 0; n < sparse.size(); ++n) ASSERT_NEAR(sparse[n], whole[pixels.of_view[1][n]], 1e-5);
}

TEST_P(RendererTest, SameSeedSameImage) {
  const Volume<float> ct = textured_volume();
  const XrayView view = centered_view(20, 40, 4.0);
  const Eigen::Isometry3d pose = random_poses(1).front();
  const auto first = rendered(*make(ct), view, pose);
  EXPECT_EQ(rendered(*make(ct), view, pose), first);
  const auto renderer = make(ct);
  rendered(*renderer, centered_view(90, 24, 6.0), pose);
  EXPECT_EQ(rendered(*renderer, view, pose), first);  // whatever was rendered before
}

TEST_P(RendererTest, VoxelsBelowTheThresholdCountAsNothing) {
  // Two blocks of 41 mm side by side in the image, at -600 HU (right) and 0 HU (left).
  Volume<float> ct = centered_volume(Vector3i(41, 41, 82), Vector3d::Constant(1.0), 0.0F);
  for (int k = 0; k < 41; ++k)
    for (int j = 0; j < 41; ++j)
      for (int i = 0; i < 41; ++i) ct.at(i, j, k) = -600.0F;
  const XrayView view = centered_view(90, 65, 1.5);
  const auto without = rendered(*make(ct, {.threshold_hu = -700}), view, Eigen::Isometry3d::Identity());
  const auto with = rendered(*make(ct, {.threshold_hu = -540}), view, Eigen::Isometry3d::Identity());
  double faint = 0.0, nothing = 0.0, dense = 0.0;
  for (int row = 20; row < 45; ++row)
    for (int column = 36; column < 56; ++column) {
      faint += without[static_cast<std::size_t>(row * 65 + column)];
      nothing += with[static_cast<std::size_t>(row * 65 + column)];
      dense += with[static_cast<std::size_t>(row * 65 + 64 - column)];
    }
  EXPECT_NEAR(faint, 500 * 41 * kWater * 0.4, 0.05 * 500 * 41 * kWater * 0.4);
  EXPECT_EQ(nothing, 0.0);
  EXPECT_NEAR(dense, 500 * 41 * kWater, 0.05 * 500 * 41 * kWater);
}

TEST_P(RendererTest, MovingThePatientEqualsMovingTheLattice) {
  const Volume<float> ct = textured_volume();
  Volume<float> moved = ct;
  const Eigen::Isometry3d motion = random_poses(1).front();
  moved.patient_from_voxel = Eigen::Affine3d(motion.matrix()) * ct.patient_from_voxel;
  const XrayView view = centered_view(45, 40, 4.0);
  const auto by_pose = rendered(*make(ct), view, motion);
  const auto by_lattice = rendered(*make(moved), view, Eigen::Isometry3d::Identity());
  // Splatting: a voxel on the border of two pixels may fall to either side by rounding.
  int differ = 0;
  for (std::size_t n = 0; n < by_pose.size(); ++n) differ += std::abs(by_pose[n] - by_lattice[n]) > 2e-3 ? 1 : 0;
  EXPECT_LE(differ, splats() ? 8 : 0);
}

TEST_P(RendererTest, EachBeamSeesItsOwnAttenuation) {
  const Volume<float> cube = centered_volume(Vector3i::Constant(41), Vector3d::Constant(2.0), 0.0F);
  const auto renderer = make(cube);
  XrayView view = centered_view(0, 33, 1.0);
  view.beam = Beam::kMegavoltage;
  const auto drr = rendered(*renderer, view, Eigen::Isometry3d::Identity());
  EXPECT_NEAR(value_at(drr, 33, 16, 16, 15), 82.0 * 0.0050, splats() ? 0.02 * 82.0 * 0.0050 : 1e-4);
}

TEST_P(RendererTest, FollowsShearedAxes) {
  // A gantry tilt of 15 degrees: the slices' axis leans in y. The integral along z through the sheared block counts the
  // same number of slices, each as thick.
  Volume<float> sheared = centered_volume(Vector3i::Constant(41), Vector3d::Constant(2.0), 0.0F);
  sheared.patient_from_voxel.linear().col(2).y() = 2.0 * std::tan(rad_from_deg(15));
  sheared.patient_from_voxel.translation() -= 20.0 * Vector3d(0, 2.0 * std::tan(rad_from_deg(15)), 0);
  const auto renderer = make(sheared);
  const auto drr = rendered(*renderer, centered_view(0, 33, 1.0), Eigen::Isometry3d::Identity());
  EXPECT_NEAR(value_at(drr, 33, 16, 16, 15), 82.0 * kWater, splats() ? 0.02 * 82.0 * kWater : 2e-3);
}

// Compares with the oracle of the same interpolation; for splatting without any fitted factor, and after the oracle is
// blurred as the default wobble blurs: by half of the largest voxel edge at the isocenter.
void expect_like_oracle(const std::vector<float>& drr, const std::vector<float>& oracle, bool splats, int columns,
                        double blur_px) {
  if (!splats) {
    EXPECT_LT(relative_error(drr, oracle), 0.005);  // 0.5 %
    return;
  }
  EXPECT_NEAR(mean_of(drr) / mean_of(oracle), 1.0, 0.01);
  EXPECT_GT(correlation(drr, blurred(oracle, columns, blur_px)), 0.99);
}

TEST_P(RendererTest, AgreesWithItsOracle) {
  const Volume<float> ct = phantom_ct();
  const auto oracle = make_renderer(oracle_kind(), ct, {}, kBothBeams);
  const auto renderer = make(ct);
  const XrayView view = centered_view(35, 96, 3.0);
  for (const Eigen::Isometry3d& pose : random_poses(3))
    expect_like_oracle(rendered(*renderer, view, pose), rendered(*oracle, view, pose), splats(), 96, 0.5);
}

TEST_P(RendererTest, AgreesOnObliqueShearedAndLeftHandedAxes) {
  const Volume<float> lattice = phantom_ct();
  Eigen::Affine3d oblique = lattice.patient_from_voxel;
  oblique.linear().col(1) *= -1.0;  // left-handed: rows run the other way
  oblique.translation().y() *= -1.0;
  oblique.linear()(1, 2) += 0.4;  // a gantry tilt: slices lean by 11 degrees
  oblique.translation() -= 0.5 * 107 * 0.4 * Vector3d::UnitY();
  oblique = Eigen::AngleAxisd(0.3, Vector3d(1, 2, 3).normalized()) * oblique;
  ASSERT_LT(oblique.linear().determinant(), 0.0);
  const Volume<float> ct = ct_of_shapes(head_phantom(Vector3d::Zero(), 1), lattice.size, oblique);
  const auto oracle = make_renderer(oracle_kind(), ct, {}, kBothBeams);
  const auto renderer = make(ct);
  const XrayView view = centered_view(35, 96, 3.0);
  const Eigen::Isometry3d pose = random_poses(1).front();
  expect_like_oracle(rendered(*renderer, view, pose), rendered(*oracle, view, pose), splats(), 96, 0.5);
}

TEST_P(RendererTest, AgreesWhereRaysRunBothWaysAlongTheirMainAxis) {
  // Thick slices seen end-on: in voxels the fan is so wide that rays at its left and right run against each other.
  Volume<float> ct = centered_volume(Vector3i(96, 96, 24), Vector3d(2.0, 2.0, 12.0), 0.0F);
  ct = ct_of_shapes(head_phantom(Vector3d::Zero(), 1), ct.size, ct.patient_from_voxel);
  const XrayView view = centered_view(0, 96, 4.0);
  const Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const auto expected = rendered(*make_renderer(oracle_kind(), ct, {}, kBothBeams), view, pose);
  const auto renderer = make(ct);
  const PixelSet pixels = PixelSet::random(std::span(&view, 1), 0.05, 1);
  const auto whole = rendered(*renderer, view, pose);
  if (!splats()) {
    EXPECT_LT(relative_error(whole, expected), 0.02);  // steps of 2 mm, planes of up to 12 mm
  }
  const RenderResult result = renderer->render(std::span(&view, 1), std::span(&pose, 1), pixels);
  const auto sparse = result.line_integrals(0, 0);
  for (std::size_t n = 0; n < sparse.size(); ++n) ASSERT_NEAR(sparse[n], whole[pixels.of_view[0][n]], 2e-5);
}

TEST_P(RendererTest, RandomPixelsAreThoseOfTheWholeImageAtEveryAngle) {
  const Volume<float> ct = textured_volume();
  const auto renderer = make(ct);
  for (const double gantry_deg : {0.0, 30.0, 45.0, 60.0, 135.0}) {
    const XrayView view = centered_view(gantry_deg, 64, 3.0);
    const Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    const auto whole = rendered(*renderer, view, pose);
    const PixelSet pixels = PixelSet::random(std::span(&view, 1), 0.05, 1);
    const RenderResult result = renderer->render(std::span(&view, 1), std::span(&pose, 1), pixels);
    const auto sparse = result.line_integrals(0, 0);
    for (std::size_t n = 0; n < sparse.size(); ++n)
      ASSERT_NEAR(sparse[n], whole[pixels.of_view[0][n]], 2e-5) << gantry_deg;
  }
}

TEST_P(RendererTest, SourcesInsideTheVolumeSeeWhatLiesBeforeThem) {
  if (splats()) GTEST_SKIP() << "a voxel beside the source falls into few pixels with a weight of its own";
  // 64 voxels of 3 mm of water about the source, once on a plane of voxels and once between two.
  const Volume<float> ct = centered_volume(Vector3i::Constant(65), Vector3d::Constant(3.0), 0.0F);
  const auto renderer = make(ct);
  const XrayView view = centered_view(0, 33, 4.0);
  for (const double aside_mm : {0.0, 1.1}) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.translation().z() = 1000.0 + aside_mm;
    // From the source down to the lower face, half a voxel below the last center.
    EXPECT_NEAR(rendered(*renderer, view, pose)[16 * 33 + 16], (32.5 * 3.0 - aside_mm) * kWater, 1.6 * kWater)
        << aside_mm;
  }
}

TEST_P(RendererTest, NothingToRenderGivesNothing) {
  const Volume<float> ct = textured_volume();
  const auto renderer = make(ct);
  const XrayView view = centered_view(0, 33, 4.0);
  const Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const RenderResult nothing = renderer->render(std::span(&view, 1), std::span(&pose, 1), {.of_view = {{}}});
  EXPECT_TRUE(nothing.line_integrals(0, 0).empty());
  renderer->render(std::span(&view, 1), {}, PixelSet::all());
  renderer->render({}, std::span(&pose, 1), PixelSet::all());
  const auto after = rendered(*renderer, view, pose);
  EXPECT_GT(mean_of(after), 0.0);
}

TEST_P(RendererTest, CallsThatMakeNoSenseAreRefused) {
  const Volume<float> ct = textured_volume();
  const auto renderer = make(ct);
  const XrayView view = centered_view(0, 33, 4.0);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  EXPECT_THROW(renderer->render(std::span(&view, 1), std::span(&pose, 1), {.of_view = {{33 * 33}}}),
               std::invalid_argument);
  EXPECT_THROW(renderer->render(std::span(&view, 1), std::span(&pose, 1), {.of_view = {{1}, {2}}}),
               std::invalid_argument);
  pose.translation().x() = std::nan("");
  EXPECT_THROW(renderer->render(std::span(&view, 1), std::span(&pose, 1), PixelSet::all()), std::invalid_argument);
}

INSTANTIATE_TEST_SUITE_P(All, RendererTest, testing::ValuesIn(all_tested()),
                         [](const auto& param) { return name_of(param.param); });

TEST(Oracles, DifferByLessThanWhatTheDocsSay) {
  // docs/algorithms.md, "Oracles": 0.8 % on this phantom; they interpolate differently and must not be equal.
  const Volume<float> ct = phantom_ct();
  const XrayView view = centered_view(35, 96, 3.0);
  const auto siddon = make_renderer(RendererKind::kSiddon, ct, {}, kBothBeams);
  const auto trilinear = make_renderer(RendererKind::kTrilinear, ct, {}, kBothBeams);
  const Eigen::Isometry3d pose = random_poses(1).front();
  const double difference = relative_error(rendered(*siddon, view, pose), rendered(*trilinear, view, pose));
  RecordProperty("difference", std::to_string(difference));
  EXPECT_GT(difference, 1e-4);
  EXPECT_LT(difference, 0.02);
}

}  // namespace
}  // namespace isoshift::renderer_test
