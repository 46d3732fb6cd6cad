// The similarities on a GPU are those on the CPU: Comparison, hand-computed in similarity_test.cc, is their oracle.
// What is on a GPU sums floats where the CPU sums doubles: differences of some 1e-6, against changes of 1e-3 that
// matter.

#include "registration/similarity/gl_similarity.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <memory>
#include <random>

#include "drr/raycast/raycast.h"
#include "geometry/patient_setup.h"
#include "phantom/xray_simulation.h"
#include "registration/objective.h"
#include "tests/drr/test_views.h"
#include "tests/support/gpu.h"
#include "tests/support/plain_renderer.h"

namespace isoshift::gl_similarity_test {
namespace {

constexpr double kTolerance = 1e-4;

struct Tested {
  SimilarityKind kind;
  GlDevice gl;
};

std::string name_of(const Tested& tested) {
  std::string name(to_string(tested.kind));
  std::ranges::replace(name, '-', '_');
  return name + (tested.gl == GlDevice::kHardware ? "_hardware" : "_software");
}

void PrintTo(const Tested& tested, std::ostream* out) { *out << name_of(tested); }

std::vector<Tested> all_tested() {
  std::vector<Tested> all;
  for (const SimilarityKind kind : kSimilarityKinds)
    for (const GlDevice gl : {GlDevice::kSoftware, GlDevice::kHardware}) all.push_back({kind, gl});
  return all;
}

// X-rays of a head by ray-shape intersections, and its CT.
struct Scene {
  std::vector<FixedImage> images;  // of 96 x 96 and 70 x 70 pixels
  Volume<float> ct;
  Eigen::Isometry3d planned;
};

const Scene& scene() {
  static const Scene made = [] {
    const std::vector<Shape> shapes = head_phantom(Eigen::Vector3d::Zero(), 5);
    const Placement placement{.translation_mm = {-3.0, 2.0, 4.0}, .rotation_deg = {-1.0, 2.0, -1.5}};
    Scene result;
    for (const Imager& imager : {Imager{.gantry_angle_deg = 0.0, .pixels = 96, .pixel_mm = 4.0},
                                 Imager{.gantry_angle_deg = 90.0, .pixels = 70, .pixel_mm = 5.0}}) {
      XrayImage xray;
      xray.view = centered_view(imager.gantry_angle_deg, imager.pixels, imager.pixel_mm);
      xray.values = simulate_xray(shapes, placement, imager, 20000.0, 1);
      result.images.push_back(prepare(xray));
    }
    const Volume<float> lattice = centered_volume({64, 77, 72}, {3.0, 3.0, 3.0}, 0.0F);
    result.ct = ct_of_shapes(shapes, lattice.size, lattice.patient_from_voxel);
    result.planned = planned_room_from_patient(PatientPosition::kHfs, {}, Eigen::Vector3d::Zero());
    return result;
  }();
  return made;
}

// About the plan, and one that no ray meets.
std::vector<Eigen::Isometry3d> poses_about_plan(int count) {
  std::vector<Eigen::Isometry3d> poses = {scene().planned};
  for (const Eigen::Isometry3d& motion : random_poses(count - 2)) poses.push_back(motion * scene().planned);
  poses.push_back(Eigen::Translation3d(0, 900, 0) * scene().planned);
  return poses;
}

double largest_difference(const std::vector<std::vector<double>>& found,
                          const std::vector<std::vector<double>>& expected) {
  EXPECT_EQ(found.size(), expected.size());
  double largest = 0.0;
  for (std::size_t pose = 0; pose < expected.size(); ++pose) {
    EXPECT_EQ(found[pose].size(), expected[pose].size());
    for (std::size_t view = 0; view < expected[pose].size(); ++view) {
      EXPECT_TRUE(std::isfinite(found[pose][view]));
      largest = std::max(largest, std::abs(found[pose][view] - expected[pose][view]));
    }
  }
  return largest;
}

class GlSimilarityTest : public testing::TestWithParam<Tested> {
 protected:
  void SetUp() override {
    if (GetParam().gl == GlDevice::kHardware) ISOSHIFT_SKIP_WITHOUT_GPU();
  }
  RendererOptions device() const { return {.gl = GetParam().gl}; }

  // Images of kColumns pixels per row; gradients are compared in their interior.
  static constexpr std::uint32_t kColumns = 23;
  Comparison comparison(const std::vector<float>& xray, const Range& drr_range) const {
    std::vector<Neighbors> neighbors;
    const auto size = static_cast<std::uint32_t>(xray.size());
    if (GetParam().kind == SimilarityKind::kGradientCorrelation)
      for (std::uint32_t n = kColumns; n + kColumns < size; ++n)
        if (n % kColumns > 0 && n % kColumns + 1 < kColumns)
          neighbors.push_back({n - 1, n + 1, n - kColumns, n + kColumns});
    return {GetParam().kind, xray, neighbors, drr_range};
  }

  // One view, one pose per DRR.
  void expect_as_on_cpu(const std::vector<float>& xray, const std::vector<std::vector<float>>& drrs, double tolerance) {
    GlContext& context = gl_context(GetParam().gl);
    context.make_current();
    const Range of_first = drrs.front().empty() ? Range() : range_of(drrs.front());  // others reach beyond it
    const std::vector<Comparison> comparisons = {comparison(xray, of_first)};
    GlSimilarity similarity(context, comparisons);
    std::vector<float> pixels;
    for (const std::vector<float>& drr : drrs) pixels.insert(pixels.end(), drr.begin(), drr.end());
    Buffer buffer;
    buffer.upload(std::as_bytes(std::span(pixels)));
    const auto found = similarity.of(buffer, drrs.size());
    ASSERT_EQ(found.size(), drrs.size());
    for (std::size_t n = 0; n < drrs.size(); ++n)
      EXPECT_NEAR(found[n][0], comparisons[0].of(drrs[n]), tolerance) << "DRR " << n;
  }
};

std::vector<float> random_pixels(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<float> line_integral(0.0F, 6.0F);
  std::vector<float> pixels(count);
  for (float& pixel : pixels) pixel = line_integral(random);
  return pixels;
}

TEST_P(GlSimilarityTest, IsThatOfTheCpuOnDrrsAndXrays) {
  RaycastGlRenderer renderer(scene().ct, {}, kBothBeams, device());
  PlainRenderer on_cpu(renderer);
  double largest = 0.0;
  for (const double fraction : {1.0, 0.1}) {
    const ObjectiveOptions options{.similarity = GetParam().kind, .pixel_fraction = fraction, .min_pixels = 100};
    Objective gpu(renderer, scene().images, scene().planned, options);
    Objective cpu(on_cpu, scene().images, scene().planned, options);
    ASSERT_NE(gpu.comparison(0).pixels(), gpu.comparison(1).pixels());
    const auto poses = poses_about_plan(9);
    const auto found = gpu.per_view(poses);
    largest = std::max(largest, largest_difference(found, cpu.per_view(poses)));
    EXPECT_EQ(gpu.per_view(poses), found) << "another time";
    EXPECT_GT(found[0][0], found.back()[0]) << "the planned pose, and one outside of the view";
  }
  EXPECT_LT(largest, kTolerance);
  RecordProperty("largest_difference", fmt::format("{:.1e}", largest));
}

TEST_P(GlSimilarityTest, ModelsAreThoseOfTheCpu) {
  RaycastGlRenderer renderer(scene().ct, {}, kBothBeams, device());
  for (const double fraction : {1.0, 0.1}) {
    const ObjectiveOptions options{.similarity = GetParam().kind, .pixel_fraction = fraction, .min_pixels = 100};
    Objective gpu(renderer, scene().images, scene().planned, options);
    const auto poses = poses_about_plan(9);
    const auto found = gpu.models(poses);
    const RenderResult drrs = gpu.render_with_derivatives(poses);
    ASSERT_EQ(found.size(), poses.size());
    for (std::size_t pose = 0; pose + 1 < poses.size(); ++pose) {
      const auto of_view = [&](std::size_t view) {
        return gpu.comparison(view).model(drrs.line_integrals(pose, view),
                                          pixel_jacobian(drrs.derivatives(pose, view)));
      };
      const QuadraticModel expected = weighted_sum(0.5, of_view(0), 0.5, of_view(1));
      EXPECT_NEAR(found[pose].value, expected.value, kTolerance);
      EXPECT_TRUE(found[pose].gradient.isApprox(expected.gradient, 1e-4)) << pose;
      EXPECT_TRUE(found[pose].curvature.isApprox(expected.curvature, 1e-4)) << pose;
      EXPECT_EQ(gpu.models(std::span(poses).subspan(pose, 1))[0].gradient, found[pose].gradient) << "alone";
    }
    const double nothing = GetParam().kind == SimilarityKind::kNormalizedMutualInformation ? 1.0 : 0.0;
    EXPECT_NEAR(found.back().value, nothing, 1e-12) << "outside of the view";
    EXPECT_TRUE(found.back().gradient.isZero() && found.back().curvature.isZero());
  }
}

TEST_P(GlSimilarityTest, IsThatOfTheCpuWhereThereIsNothingToCompare) {
  const std::vector<float> xray = random_pixels(kColumns * 17, 1);
  std::vector<float> one_bin = random_pixels(xray.size(), 2), half = random_pixels(xray.size(), 3);
  one_bin[100] = 1e5F;  // the bins between least and largest value hold all others in the first
  std::fill(half.begin(), half.begin() + static_cast<std::ptrdiff_t>(half.size() / 2), 0.0F);
  const std::vector<float> black(xray.size(), 0.0F), constant(xray.size(), 3.7F);
  expect_as_on_cpu(xray, {one_bin, half, xray}, kTolerance);
  // Correlations are exactly 0 then; entropies are added up in another order.
  const bool is_information = GetParam().kind == SimilarityKind::kMutualInformation ||
                              GetParam().kind == SimilarityKind::kNormalizedMutualInformation;
  expect_as_on_cpu(xray, {black, constant}, is_information ? 1e-5 : 0.0);
  expect_as_on_cpu(constant, {black, constant, one_bin, xray}, is_information ? 1e-5 : 0.0);
  expect_as_on_cpu({1.0F}, {{2.0F}, {0.0F}}, kTolerance);
  expect_as_on_cpu({}, {{}}, kTolerance);
}

TEST_P(GlSimilarityTest, TiesOnTheBordersOfBinsFallToTheSameSide) {
  // Whole numbers up to 256 and 31 are on the borders of the ranks' and of the information's bins.
  for (const float levels : {2.0F, 31.0F, 128.0F, 255.0F, 256.0F}) {
    std::vector<std::vector<float>> drrs;
    for (const float unit : {1.0F, 0.1F, 0.0237F}) {
      drrs.push_back(random_pixels(kColumns * 40, 4));
      for (float& pixel : drrs.back()) pixel = unit * std::round(pixel / 6.0F * levels);
    }
    expect_as_on_cpu(random_pixels(kColumns * 40, 5), drrs, 1e-5);
  }
}

TEST_P(GlSimilarityTest, LargeOffsetsAndManyPixelsCostNoPrecision) {
  std::vector<float> xray = random_pixels(kColumns * 40000, 6), drr = xray;
  const std::vector<float> noise = random_pixels(xray.size(), 7);
  for (std::size_t n = 0; n < drr.size(); ++n) drr[n] = 1000.0F + 0.5F * xray[n] + 0.1F * noise[n];
  expect_as_on_cpu(xray, {drr, noise}, kTolerance);
}

TEST_P(GlSimilarityTest, RenderersAndObjectivesDoNotDisturbEachOther) {
  const ObjectiveOptions options{.similarity = GetParam().kind, .pixel_fraction = 0.1, .min_pixels = 100};
  const auto poses = poses_about_plan(3);
  RaycastGlRenderer first(scene().ct, {}, kBothBeams, device());
  auto second = std::make_unique<RaycastGlRenderer>(scene().ct, AttenuationModel{}, kBothBeams, device());
  Objective of_first(first, scene().images, scene().planned, options);
  auto of_second = std::make_unique<Objective>(*second, scene().images, scene().planned, options);
  const auto expected = of_first.per_view(poses);
  EXPECT_EQ(of_second->per_view(poses), expected);
  EXPECT_EQ(of_first.per_view(poses), expected);
  of_second.reset();
  second.reset();
  EXPECT_EQ(of_first.per_view(poses), expected) << "after the end of the second";
}

INSTANTIATE_TEST_SUITE_P(All, GlSimilarityTest, testing::ValuesIn(all_tested()),
                         [](const auto& param) { return name_of(param.param); });

TEST(GlSimilarity, TakesMorePosesThanWorkGroups) {
  GlContext& context = gl_context(GlDevice::kSoftware);
  context.make_current();
  const std::vector<float> xray = {1, 2, 3, 4};
  const std::vector<Comparison> comparisons(1, Comparison(SimilarityKind::kNcc, xray));
  GlSimilarity similarity(context, comparisons);
  constexpr std::size_t kPoses = 65535 + 2;
  std::vector<float> drrs;
  for (std::size_t pose = 0; pose < kPoses; ++pose) drrs.insert(drrs.end(), {2, 1, 4, 3});
  std::copy_n(std::array<float, 4>{4, 3, 2, 1}.begin(), 4, drrs.end() - 4);
  Buffer buffer;
  buffer.upload(std::as_bytes(std::span(drrs)));
  const auto found = similarity.of(buffer, kPoses);
  EXPECT_NEAR(found[kPoses - 2][0], 0.6, 1e-6);
  EXPECT_NEAR(found[kPoses - 1][0], -1.0, 1e-6);
}

TEST(GlSimilarity, TakesMorePosesThanOneBufferHolds) {
  // A panel of 4 m: few of its rays meet anything, which keeps this quick.
  RaycastGlRenderer renderer(textured_volume(), {}, kBothBeams, {.gl = GlDevice::kSoftware});
  constexpr int kPixels = 1024;
  const XrayView view = centered_view(0, kPixels, 4.0);
  FixedImage image{
      .view = view, .line_integral = Image<float>(kPixels, kPixels), .field = Image<std::uint8_t>(kPixels, kPixels, 1)};
  for (int column = kPixels / 2; column < kPixels / 2 + 10; ++column)
    image.line_integral.at(column, kPixels / 2) = 1.0F;
  const std::size_t at_once = renderer.poses_at_once(image.field.pixels.size(), false);
  if (at_once > 100) GTEST_SKIP() << "storage buffers hold " << at_once << " poses: too slow";
  const auto poses = random_poses(static_cast<int>(at_once) + 1);
  Objective objective(renderer, std::span(&image, 1), poses.front(), {});
  const auto all = objective.per_view(poses);
  ASSERT_EQ(all.size(), poses.size());
  EXPECT_NE(all.back(), all.front());
  EXPECT_EQ(all.back(), objective.per_view(std::span(poses).last(1))[0]);
  EXPECT_EQ(all.front(), objective.per_view(std::span(poses).first(1))[0]);
}

TEST(GlSimilarity, OnlyTheComputeRayCasterLeavesItsLineIntegralsOnTheGpu) {
  const Volume<float> ct = textured_volume();
  for (const RendererKind kind : kRendererKinds) {
    const auto renderer = make_renderer(kind, ct, {}, kBothBeams, {.gl = GlDevice::kSoftware});
    EXPECT_EQ(renderer->on_gpu() != nullptr, kind == RendererKind::kRaycast) << to_string(kind);
  }
}

TEST(GlSimilarity, SecondsOfTheObjectiveAddUp) {
  RaycastGlRenderer renderer(scene().ct, {}, kBothBeams, {.gl = GlDevice::kSoftware});
  Objective objective(renderer, scene().images, scene().planned, {});
  const auto begin = std::chrono::steady_clock::now();
  objective.per_view(poses_about_plan(9));
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  EXPECT_GT(objective.seconds().rendering, 0.0);
  EXPECT_GT(objective.seconds().similarity, 0.0);
  EXPECT_LE(objective.seconds().rendering + objective.seconds().similarity, seconds);
  EXPECT_TRUE(objective.per_view({}).empty());
}

}  // namespace
}  // namespace isoshift::gl_similarity_test
