#include "registration/preprocess/field_sides.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace isoshift {
namespace {

constexpr double kBlockMm = 5.0;   // along the side
constexpr double kWindowMm = 8.0;  // across it, to either side
constexpr double kWeightMm = 4.0;  // sigma of the weights in the window: what is near the edge tells its place
constexpr double kPlacesMm = 3.5;  // the edge lies so near to where it is looked for
constexpr double kPlaceStepMm = 0.35;
constexpr double kBestSigmaMm = 0.05;  // what no edge is measured better than
constexpr double kMaxSlope = 0.035;    // 2 degrees
constexpr double kSlopeSigma = 0.003;  // what no slope is measured better than: what lies behind an edge may slope
constexpr double kSameMm = 0.06;       // blocks of one edge differ by so much
constexpr double kFarMm = 0.4;         // and hardly by more

double middle_value(std::vector<double> values) {
  if (values.empty()) return 0.0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

// The mean profile of a block of rows.
struct Block {
  double row = 0.0;  // its middle
  Eigen::VectorXd intensity;
};

std::vector<Block> blocks_of(const UprightXray& xray, int from, int count, int first_row, int end_row) {
  const int rows = std::max(1, static_cast<int>(std::lround(kBlockMm / xray.mm)));
  std::vector<Block> blocks;
  for (int row = first_row; row + rows <= end_row; row += rows) {
    Block block{.row = row + 0.5 * rows, .intensity = Eigen::VectorXd::Zero(count)};
    bool is_valid = true;
    for (int r = row; r < row + rows; ++r)
      for (int n = 0; n < count; ++n) {
        is_valid = is_valid && xray.valid.at<std::uint8_t>(r, from + n) != 0;
        block.intensity[n] += xray.intensity.at<float>(r, from + n) / rows;
      }
    if (is_valid) blocks.push_back(std::move(block));
  }
  return blocks;
}

// The model of an edge at one place with one blur, in which the intensity is linear: inside a + b x, outside c, d x.
class EdgeModel {
 public:
  EdgeModel(int count, double pixel_mm, double middle_mm, double at_mm, double blur_mm, int sign)
      : design_(count, 4), passing_slope_(count), weight_(count) {
    for (int n = 0; n < count; ++n) {
      const double x = (n + 0.5) * pixel_mm - at_mm;
      const double passing = 0.5 * std::erfc(-sign * x / (blur_mm * std::numbers::sqrt2));
      weight_[n] = std::exp(-0.5 * std::pow(((n + 0.5) * pixel_mm - middle_mm) / kWeightMm, 2));
      design_.row(n) << passing, passing * x, 1.0 - passing, (1.0 - passing) * x;
      design_.row(n) *= weight_[n];
      passing_slope_[n] = std::exp(-0.5 * x * x / (blur_mm * blur_mm)) / (blur_mm * std::sqrt(2.0 * std::numbers::pi));
    }
    solver_.compute(design_);
  }

  // Sum of squares that it leaves.
  double left(const Eigen::VectorXd& intensity) const {
    const Eigen::VectorXd weighted = weight_.cwiseProduct(intensity);
    return (weighted - design_ * solver_.solve(weighted)).squaredNorm();
  }
  // Step from outside to inside.
  double step(const Eigen::VectorXd& intensity) const {
    const Eigen::VectorXd solution = solver_.solve(weight_.cwiseProduct(intensity));
    return solution[0] - solution[2];
  }
  double passing_slope_squared() const { return passing_slope_.squaredNorm(); }

 private:
  Eigen::MatrixXd design_;
  Eigen::VectorXd passing_slope_, weight_;
  Eigen::HouseholderQR<Eigen::MatrixXd> solver_;
};

// All places of one blur.
struct BlurFit {
  std::vector<Sighting> seen;
  double left = 0.0;  // relative to the steps
};

BlurFit fit_with(const std::vector<Block>& blocks, int count, double pixel_mm, double middle_mm, double blur_mm,
                 int sign) {
  std::vector<EdgeModel> models;
  std::vector<double> places;
  const int steps = static_cast<int>(std::lround(2.0 * kPlacesMm / kPlaceStepMm));
  for (int n = 0; n <= steps; ++n) {
    places.push_back(middle_mm - kPlacesMm + n * kPlaceStepMm);
    models.emplace_back(count, pixel_mm, middle_mm, places.back(), blur_mm, sign);
  }
  BlurFit fit;
  for (const Block& block : blocks) {
    std::vector<double> left(models.size());
    std::ranges::transform(models, left.begin(), [&](const EdgeModel& m) { return m.left(block.intensity); });
    const auto best = static_cast<std::size_t>(std::ranges::min_element(left) - left.begin());
    const double step = models[best].step(block.intensity);
    const double brightest = std::max(block.intensity.maxCoeff(), 1e-9);
    fit.left += std::log(left[best] / (brightest * brightest) + 1e-7);
    if (best == 0 || best + 1 == models.size() || step < 0.1 * brightest) continue;
    const double curvature = left[best - 1] - 2.0 * left[best] + left[best + 1];
    const double off = curvature > 0.0 ? 0.5 * (left[best - 1] - left[best + 1]) / curvature : 0.0;
    const double noise_squared = left[best] / std::max(1, count - 6);
    const double sigma = std::sqrt(noise_squared / models[best].passing_slope_squared()) / step;
    fit.seen.push_back({.row = block.row,
                        .at = (places[best] + std::clamp(off, -0.5, 0.5) * kPlaceStepMm) / pixel_mm,
                        .sigma_mm = std::hypot(sigma, kBestSigmaMm)});
  }
  return fit;
}

SideSightings sightings_at(const UprightXray& xray, int near, int sign, int first, int end, double penumbra_mm) {
  const int reach = static_cast<int>(std::lround(kWindowMm / xray.mm));
  const int from = std::max(0, near - reach), count = std::min(xray.intensity.cols, near + reach) - from;
  if (count < reach) return {};
  const std::vector<Block> blocks = blocks_of(xray, from, count, first, end);
  BlurFit best = fit_with(blocks, count, xray.mm, (near - from) * xray.mm, penumbra_mm, sign);
  for (Sighting& sighting : best.seen) sighting.at += from;
  return {.seen = std::move(best.seen), .blocks = static_cast<int>(blocks.size()), .misfit = best.left};
}

}  // namespace

SideSightings sightings_of_side(const UprightXray& xray, int near, int sign, int first, int end, double penumbra_mm) {
  // The logarithm falls most outside of where half the beam arrives: by 1 mm, or by more where the penumbra is wide.
  SideSightings best;
  for (const double inward_mm : {1.0, 3.0, 4.5}) {
    SideSightings other = sightings_at(xray, near + sign * static_cast<int>(std::lround(inward_mm / xray.mm)), sign,
                                       first, end, penumbra_mm);
    if (other.seen.size() > best.seen.size() || best.blocks == 0) best = std::move(other);
    if (4 * best.seen.size() >= 3 * static_cast<std::size_t>(best.blocks)) break;
  }
  return best;
}

SideLine line_through(const std::vector<Sighting>& seen, double pixel_mm, double slope, double slope_sigma) {
  const auto count = static_cast<double>(seen.size());
  std::vector<double> places;
  SideLine line{.slope = slope};
  for (const Sighting& sighting : seen) {
    places.push_back(sighting.at);
    line.middle += sighting.row / count;
  }
  line.at = middle_value(places);
  for (int round = 0; round < 10; ++round) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    for (const Sighting& sighting : seen) {
      const double y = (sighting.row - line.middle) * pixel_mm;
      const double off = (sighting.at - line.x(sighting.row)) * pixel_mm;
      const double weight =
          1.0 / (std::pow(sighting.sigma_mm, 2) + std::pow(kSameMm, 2)) / (1.0 + std::pow(off / kFarMm, 2));
      normal += weight * Eigen::Vector2d(1, y) * Eigen::RowVector2d(1, y);
      right += weight * sighting.at * pixel_mm * Eigen::Vector2d(1, y);
    }
    normal(1, 1) += 1.0 / (slope_sigma * slope_sigma);
    right[1] += slope / (slope_sigma * slope_sigma);
    const Eigen::Vector2d solution = normal.ldlt().solve(right);
    line.at = solution[0] / pixel_mm;
    line.slope = std::clamp(solution[1], -kMaxSlope, kMaxSlope);
  }
  std::vector<double> off;
  double square_mm2 = 0.0;
  for (const Sighting& sighting : seen) {
    off.push_back(pixel_mm * std::abs(sighting.at - line.x(sighting.row)));
    square_mm2 += std::pow((sighting.row - line.middle) * pixel_mm, 2);
  }
  line.scatter_mm = 1.48 * middle_value(off);
  line.sigma_mm = std::hypot(line.scatter_mm / std::sqrt(count), kBestSigmaMm);
  line.slope_sigma = std::hypot(std::max(line.scatter_mm, kSameMm) / std::sqrt(square_mm2 + 1.0), kSlopeSigma);
  return line;
}

double brightness_beyond(const UprightXray& xray, int at, int sign, int first, int end) {
  const int near = std::max(1, static_cast<int>(std::lround(4.0 / xray.mm)));
  const int far = static_cast<int>(std::lround(40.0 / xray.mm));
  std::vector<double> rises;
  const int width = xray.intensity.cols;
  for (int row = first; row < end; row += 2) {
    const auto* intensity = xray.intensity.ptr<float>(row);
    const auto* valid = xray.valid.ptr<std::uint8_t>(row);
    float inside = 0.0F, beyond = 0.0F;
    for (int off = 1; off <= far; ++off) {
      const int in = sign > 0 ? at + off : at - 1 - off, out = sign > 0 ? at - 1 - off : at + off;
      if (off >= near / 2 && off <= 2 * near && in >= 0 && in < width) inside = std::max(inside, intensity[in]);
      if (off >= near && out >= 0 && out < width && valid[out] != 0) beyond = std::max(beyond, intensity[out]);
    }
    rises.push_back(std::log((beyond + 1e-3) / (inside + 1e-3)));
  }
  return middle_value(rises);
}

}  // namespace isoshift
