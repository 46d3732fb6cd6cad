// What wobbling is for: it takes the comb of the slices out of the image, and blurs like the penumbra of a focal spot.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "base/error.h"
#include "drr/renderer.h"
#include "tests/drr/test_views.h"

namespace isoshift::splat_test {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

std::vector<float> splatted(const Volume<float>& ct, const XrayView& view, const SplatOptions& splat,
                            RendererKind kind = RendererKind::kSplatBuffers) {
  const auto renderer = make_renderer(kind, ct, {}, kBothBeams, {.gl = GlDevice::kSoftware, .splat = splat});
  const Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const RenderResult result = renderer->render(std::span(&view, 1), std::span(&pose, 1), PixelSet::all());
  const auto pixels = result.line_integrals(0, 0);
  return {pixels.begin(), pixels.end()};
}

// The largest spectral amplitude of the mean profile along the columns, within 10 % of a frequency, 1/pixel.
double spectral_peak(const std::vector<float>& drr, int pixels, double frequency) {
  const int rim = pixels / 8;
  std::vector<double> profile;
  for (int column = rim; column < pixels - rim; ++column) {
    double sum = 0.0;
    for (int row = rim; row < pixels - rim; ++row) sum += drr[static_cast<std::size_t>(row * pixels + column)];
    profile.push_back(sum / (pixels - 2 * rim));
  }
  double peak = 0.0;
  for (double f = 0.9 * frequency; f <= 1.1 * frequency; f += 0.002 * frequency) {
    std::complex<double> sum = 0.0;
    for (std::size_t n = 0; n < profile.size(); ++n) {
      const double turn = 2.0 * std::numbers::pi * static_cast<double>(n);
      const double window = 1.0 - std::cos(turn / static_cast<double>(profile.size() - 1));  // Hann: keeps the mean out
      sum += window * profile[n] * std::polar(1.0, -turn * f);
    }
    peak = std::max(peak, std::abs(sum) / static_cast<double>(profile.size()));
  }
  return peak;
}

class SliceComb : public testing::TestWithParam<std::tuple<double, RendererKind, SplatOptions::Wobble>> {};

TEST_P(SliceComb, FallsToFivePercentAtTheDefaultSigma) {
  // Slices across x, 20 mm of water about the isocenter, pixels of a third of the thinnest slice.
  const auto [slice_mm, kind, wobble] = GetParam();
  const int slices = static_cast<int>(90.0 / slice_mm);
  const Volume<float> ct = centered_volume(Vector3i(slices, 90, 20), Vector3d(slice_mm, 1.0, 1.0), 0.0F);
  const XrayView view = centered_view(0, 256, 0.5);
  const double frequency = 0.5 / (slice_mm * 1.5);  // of slices magnified by SID / SAD, per pixel
  const double comb = spectral_peak(splatted(ct, view, {.wobble = wobble, .sigma_mm = 0.0}, kind), 256, frequency);
  const double wobbled = spectral_peak(splatted(ct, view, {.wobble = wobble}, kind), 256, frequency);
  RecordProperty("comb", fmt::format("{:.4f}", comb));
  RecordProperty("wobbled", fmt::format("{:.4f}", wobbled));
  EXPECT_GT(comb, 0.1);
  EXPECT_LE(wobbled, 0.05 * comb) << comb << " without, " << wobbled << " with wobble";
}

INSTANTIATE_TEST_SUITE_P(Slices, SliceComb,
                         testing::Combine(testing::Values(1.0, 2.0, 3.0),
                                          testing::Values(RendererKind::kSplatBuffers, RendererKind::kSplatTexture),
                                          testing::Values(SplatOptions::Wobble::kFocus, SplatOptions::Wobble::kVoxel)),
                         [](const auto& param) {
                           return fmt::format(
                               "{}_mm_{}_{}", static_cast<int>(std::get<0>(param.param)),
                               std::get<1>(param.param) == RendererKind::kSplatBuffers ? "buffers" : "texture",
                               std::get<2>(param.param) == SplatOptions::Wobble::kFocus ? "focus" : "voxel");
                         });

// How far the shadows of single voxels, 10 mm apart in one plane, lie from where they project to without wobble:
// standard deviation on the receptor along columns and rows, mm.
Eigen::Vector2d spread_mm(double plane_z_mm, const SplatOptions& splat) {
  constexpr int kVoxels = 41, kPixels = 2000;
  constexpr double kPixelMm = 0.4;
  Volume<float> ct = centered_volume(Vector3i(kVoxels, kVoxels, 1), Vector3d(10.0, 10.0, 1.0), 0.0F);
  ct.patient_from_voxel.translation().z() = plane_z_mm;
  const XrayView view = centered_view(0, kPixels, kPixelMm);
  const auto drr = splatted(ct, view, splat);
  const double magnification = 1500.0 / (1000.0 - plane_z_mm);
  const double pitch_px = 10.0 * magnification / kPixelMm, middle_px = 0.5 * (kPixels - 1);
  Eigen::Array2d sum = Eigen::Array2d::Zero();
  double count = 0.0;
  for (int row = 0; row < kPixels; ++row)
    for (int column = 0; column < kPixels; ++column) {
      if (drr[static_cast<std::size_t>(row * kPixels + column)] == 0.0F) continue;
      Eigen::Array2d from_middle(column - middle_px, row - middle_px);
      const Eigen::Array2d from_nearest = from_middle - (from_middle / pitch_px).round() * pitch_px;
      sum += from_nearest.square();
      count += 1.0;
    }
  EXPECT_NEAR(count, kVoxels * kVoxels, 8) << "voxels that share a pixel";
  // What falls anywhere in a pixel is counted at its center: 1/12 of a pixel's square.
  return (kPixelMm * (sum / count - 1.0 / 12.0).sqrt()).matrix();
}

TEST(SplatWobble, FocusBlursWithTheHeightAboveTheReceptor) {
  // Birkfellner 2005: u = (z fx - x fz + z d) / (z - fz) with the receptor at z = 0, the focus at fz, the voxel at z: a
  // displacement d of the focus moves the shadow by z d / (fz - z). 1681 voxels give sigma within 1.7 %.
  for (const double z_mm : {-300.0, -100.0, 0.0, 150.0}) {
    const double height_mm = 500.0 + z_mm;
    const double expected_mm = 1.5 * height_mm / (1500.0 - height_mm);
    const Eigen::Vector2d found_mm = spread_mm(z_mm, {.sigma_mm = 1.5});
    EXPECT_NEAR(found_mm.x(), expected_mm, 0.06 * expected_mm + 0.01) << "at " << z_mm;
    EXPECT_NEAR(found_mm.y(), expected_mm, 0.06 * expected_mm + 0.01) << "at " << z_mm;
  }
}

TEST(SplatWobble, VoxelsBlurWithTheirMagnification) {
  for (const double z_mm : {-300.0, 0.0, 150.0}) {
    const double expected_mm = 1500.0 / (1000.0 - z_mm);
    const Eigen::Vector2d found_mm = spread_mm(z_mm, {.wobble = SplatOptions::Wobble::kVoxel, .sigma_mm = 1.0});
    EXPECT_NEAR(found_mm.x(), expected_mm, 0.06 * expected_mm) << "at " << z_mm;
    EXPECT_NEAR(found_mm.y(), expected_mm, 0.06 * expected_mm) << "at " << z_mm;
  }
}

TEST(SplatWobble, DefaultBlursAVoxelAtTheIsocenterByHalfItsLargestEdge) {
  const XrayView view = centered_view(0, 64, 1.0);
  // On the receptor sigma (SID - SAD) / SAD = 0.5 spacing SID / SAD.
  EXPECT_NEAR(default_sigma_mm(SplatOptions::Wobble::kFocus, 3.0, view), 0.5 * 3.0 * 1500.0 / 500.0, 1e-9);
  EXPECT_NEAR(default_sigma_mm(SplatOptions::Wobble::kVoxel, 3.0, view), 1.5, 1e-9);
}

TEST(SplatWobble, SeedsDiffer) {
  const Volume<float> ct = textured_volume();
  const XrayView view = centered_view(20, 40, 4.0);
  for (const RendererKind kind : {RendererKind::kSplat, RendererKind::kSplatTexture})
    EXPECT_NE(splatted(ct, view, {.seed = 1}, kind), splatted(ct, view, {.seed = 2}, kind)) << to_string(kind);
}

TEST(SplatWobble, SentAndKeptVoxelsGiveTheSameImage) {
  const Volume<float> ct = textured_volume();
  const XrayView view = centered_view(20, 40, 4.0);
  EXPECT_EQ(splatted(ct, view, {}, RendererKind::kSplat), splatted(ct, view, {}, RendererKind::kSplatBuffers));
}

TEST(SplatDeposit, BilinearSharesAmongFourPixelsAndKeepsTheSum) {
  Volume<float> ct = centered_volume(Vector3i::Constant(3), Vector3d::Constant(1.0), -1000.0F);
  ct.at(1, 1, 1) = 0.0F;
  // An even number of pixels: the voxel's center projects to where four pixels meet.
  const XrayView view = centered_view(0, 32, 1.0);
  const auto nearest = splatted(ct, view, {.sigma_mm = 0.0});
  const auto shared = splatted(ct, view, {.deposit = SplatOptions::Deposit::kBilinear, .sigma_mm = 0.0});
  EXPECT_EQ(std::ranges::count_if(nearest, [](float value) { return value > 0.0F; }), 1);
  EXPECT_NEAR(mean_of(shared), mean_of(nearest), 1e-6 * mean_of(nearest));
  for (const int row : {15, 16})
    for (const int column : {15, 16})
      EXPECT_NEAR(shared[static_cast<std::size_t>(row * 32 + column)] / *std::ranges::max_element(nearest), 0.25, 1e-3);
}

TEST(SplatOptions, BadOnesAreRefused) {
  const Volume<float> ct = textured_volume();
  const auto make = [&](double sigma_mm) {
    make_renderer(RendererKind::kSplat, ct, {}, kBothBeams,
                  {.gl = GlDevice::kSoftware, .splat = {.sigma_mm = sigma_mm}});
  };
  EXPECT_THROW(make(-1.0), UsageError);
  EXPECT_THROW(make(std::nan("")), UsageError);
}

}  // namespace
}  // namespace isoshift::splat_test
