#include "registration/preprocess/field_sides.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include "base/median.h"
#include "geometry/linear_algebra.h"

namespace isoshift {
namespace {

constexpr double kBlockMm = 5.0;           // along the side
constexpr double kOutwardMm = 8.0;         // the window across it, from where the logarithm of the intensity falls most
constexpr double kInwardMm = 12.0;         // where half the beam arrives lies further in
constexpr double kWeightMm = 5.0;          // sigma of the weights in the window: what is near the edge tells its place
constexpr double kDarkShare = 0.03;        // of the brightest intensity of a block: what is darker counts less;
constexpr double kDarkShareOfSlope = 0.3;  // the same where it darkens all the way to another edge
constexpr double kFirstPlaceMm = -1.2;     // places from so far outside of where the logarithm falls most
constexpr double kLastPlaceMm = 1.0;       // to so far inside,
constexpr double kLastPlaceSigmas = 1.7;   // and so many sigmas of the penumbra
constexpr double kPlaceStepMm = 0.3;       // of the places
constexpr double kFinePlaceStepMm = 0.06;  // of those near the line
constexpr double kBestSigmaMm = 0.05;      // what no side is measured better than
constexpr double kTurnStep = 0.0015;       // radians, 0.09 degrees
constexpr int kTurns = 8;                  // steps to either side
constexpr double kMisfitFloor = 1e-4;      // mean square of the relative misfit: no block fits better than 1 %
constexpr double kMostMisfit = 3.0;        // logarithm: a block that the line misfits by more speaks no louder
constexpr double kNearlyMisfit = 0.5;      // mean logarithm: what fits worse by less fits nearly as well
// Sigmas of the penumbra.
constexpr double kFirstPenumbraMm = 0.9, kLeastPenumbraMm = 0.25, kMostPenumbraMm = 2.5;

// The mean profile of a block of rows, outside first.
struct Block {
  double row = 0.0;  // its middle
  Eigen::VectorXd intensity, weight;
};

std::vector<Block> blocks_of(const SideToMeasure& side, int outward, int count) {
  const UprightXray& xray = *side.xray;
  const int rows = std::max(1, static_cast<int>(std::lround(kBlockMm / xray.mm)));
  std::vector<Block> blocks;
  for (int row = side.first; row + rows <= side.end; row += rows) {
    Block block{
        .row = row + 0.5 * rows, .intensity = Eigen::VectorXd::Zero(count), .weight = Eigen::VectorXd::Zero(count)};
    for (int n = 0; n < count; ++n) {
      const int column = side.sign > 0 ? side.near - outward + n : side.near - 1 + outward - n;
      if (column < 0 || column >= xray.intensity.cols) continue;
      bool is_valid = true;
      for (int r = row; r < row + rows; ++r) {
        is_valid = is_valid && xray.valid.at<std::uint8_t>(r, column) != 0;
        block.intensity[n] += xray.intensity.at<float>(r, column) / rows;
      }
      const double off_mm = (n + 0.5 - outward) * xray.mm - 1.0;
      if (is_valid) block.weight[n] = std::exp(-0.5 * std::pow(off_mm / kWeightMm, 2));
    }
    const double floor =
        (side.has_slope ? kDarkShareOfSlope : kDarkShare) * block.intensity.cwiseProduct(block.weight).maxCoeff();
    if (!(floor > 0.0)) continue;
    double sum = block.weight.sum();
    if (sum * xray.mm < kWeightMm) continue;
    for (int n = 0; n < count; ++n) block.weight[n] /= sum * std::pow(std::max(block.intensity[n], 0.0) + floor, 2);
    blocks.push_back(std::move(block));
  }
  return blocks;
}

// What passes an edge, sample by sample of a profile: one place, one penumbra.
using Basis = Eigen::Matrix<double, Eigen::Dynamic, 5>;

Basis basis_of(int count, int outward, double pixel_mm, double place_mm, double penumbra_mm) {
  constexpr double kUnitMm = 5.0;
  Basis basis(count, 5);
  for (int n = 0; n < count; ++n) {
    const double x = (n + 0.5 - outward) * pixel_mm - place_mm;
    const double passing = 0.5 * std::erfc(-x / (penumbra_mm * std::numbers::sqrt2)), u = x / kUnitMm;
    basis.row(n) << passing, passing * u, passing * u * u, 1.0 - passing, (1.0 - passing) * u;
  }
  return basis;
}

// The logarithm of what the model leaves of a block: inside a + b x + c x^2, outside d + e x. Large where it is darker
// inside.
double misfit_of(const Block& block, const Basis& basis) {
  using Matrix = Eigen::Matrix<double, 5, 5>;
  using Vector = Eigen::Matrix<double, 5, 1>;
  const Basis weighted = block.weight.asDiagonal() * basis;
  Matrix normal = basis.transpose() * weighted;
  const Vector right = weighted.transpose() * block.intensity;
  const double square = block.intensity.dot(block.weight.cwiseProduct(block.intensity));
  normal.diagonal() += 1e-6 * normal.trace() * Vector(0.01, 1.0, 1.0, 0.01, 1.0);
  const Vector solution = solve_symmetric(normal, right);
  const double left = std::max(0.0, square - 2.0 * solution.dot(right) + solution.dot(normal * solution));
  return std::log(left + kMisfitFloor);
}

// How well edges at several places explain the blocks of a side.
class SideMisfits {
 public:
  SideMisfits(const SideToMeasure& side)
      : side_(side),
        mm_(side.xray->mm),
        outward_(static_cast<int>(std::lround(kOutwardMm / mm_))),
        count_(outward_ + static_cast<int>(std::lround(kInwardMm / mm_))),
        blocks_(blocks_of(side, outward_, count_)),
        best_(blocks_.size(), 1e9) {
    for (const Block& block : blocks_) middle_ += block.row / static_cast<double>(blocks_.size());
  }

  bool is_empty() const { return blocks_.empty(); }
  int blocks() const { return static_cast<int>(blocks_.size()); }
  double middle() const { return middle_; }

  // Misfits at places `first_mm + n * step_mm` inward of `near`.
  void look(double first_mm, double step_mm, int places, double penumbra_mm) {
    first_mm_ = first_mm;
    step_mm_ = step_mm;
    misfits_.resize(places, blocks());
    for (int n = 0; n < places; ++n) {
      const Basis basis = basis_of(count_, outward_, mm_, first_mm + n * step_mm, penumbra_mm);
      for (int b = 0; b < blocks(); ++b) misfits_(n, b) = misfit_of(blocks_[static_cast<std::size_t>(b)], basis);
    }
    for (int b = 0; b < blocks(); ++b) {
      double& best = best_[static_cast<std::size_t>(b)];
      best = std::min(best, misfits_.col(b).minCoeff());
    }
  }

  // The sum over all blocks for a line at `place_mm` (of its middle) with this slope.
  double of_line(double place_mm, double slope) const {
    double sum = 0.0;
    for (int b = 0; b < blocks(); ++b) {
      const auto number = static_cast<std::size_t>(b);
      const double off_mm = side_.sign * slope * (blocks_[number].row - middle_) * mm_;
      const double at = std::clamp((place_mm + off_mm - first_mm_) / step_mm_, 0.0, misfits_.rows() - 1.000001);
      const int below = static_cast<int>(at);
      const double misfit = misfits_(below, b) + (at - below) * (misfits_(below + 1, b) - misfits_(below, b));
      sum += std::min(misfit - best_[number], kMostMisfit) + best_[number];
    }
    return sum;
  }

  // The place of the best line with this slope.
  struct Best {
    double place_mm = 0.0, misfit = 1e30;
  };
  Best best_line(double slope) const {
    Best best;
    for (int n = 0; n < misfits_.rows(); ++n) {
      const double misfit = of_line(place(n), slope);
      if (misfit < best.misfit) best = {place(n), misfit};
    }
    return best;
  }

  // How far from `best` a line with this slope fits nearly as well.
  double reach_mm(const Best& best, double slope) const {
    double reach = 0.0;
    const int places =
        1 + static_cast<int>((place(static_cast<int>(misfits_.rows()) - 1) - first_mm_) / kFinePlaceStepMm);
    for (int n = 0; n < places; ++n) {
      const double at = first_mm_ + n * kFinePlaceStepMm;
      if (of_line(at, slope) < best.misfit + kNearlyMisfit * blocks())
        reach = std::max(reach, std::abs(at - best.place_mm));
    }
    return reach;
  }

  // How far the blocks by themselves lie from a line: of those with an edge within the places.
  std::vector<double> off_line(double place_mm, double slope) const {
    std::vector<double> off;
    for (int b = 0; b < blocks(); ++b) {
      Eigen::Index least = 0;
      misfits_.col(b).minCoeff(&least);
      if (least == 0 || least + 1 == misfits_.rows()) continue;
      const double line_mm = place_mm + side_.sign * slope * (blocks_[static_cast<std::size_t>(b)].row - middle_) * mm_;
      const double below = misfits_(least - 1, b), above = misfits_(least + 1, b);
      const double curvature = below - 2.0 * misfits_(least, b) + above;
      const double between = curvature > 0.0 ? 0.5 * (below - above) / curvature : 0.0;
      off.push_back(std::abs(place(static_cast<int>(least)) + between * step_mm_ - line_mm));
    }
    return off;
  }

  // Pixels of the image.
  double at(double place_mm) const { return side_.near + side_.sign * place_mm / mm_; }
  int slope_sign() const { return side_.slope_sign; }

 private:
  double place(int n) const { return first_mm_ + n * step_mm_; }

  const SideToMeasure& side_;
  double mm_;
  int outward_, count_;
  std::vector<Block> blocks_;
  std::vector<double> best_;  // misfit of every block at its best place, of all that were looked at
  double middle_ = 0.0, first_mm_ = 0.0, step_mm_ = 1.0;
  Eigen::MatrixXd misfits_;  // places x blocks
};

// The turn that all sides share, and what the best lines leave with it.
struct Turned {
  double turn = 0.0, misfit = 1e30;
};

Turned best_turn(std::span<const SideMisfits> sides, double turn_sigma) {
  Turned best;
  for (int n = -kTurns; n <= kTurns; ++n) {
    const double turn = n * kTurnStep;
    double misfit = 0.5 * std::pow(turn / turn_sigma, 2);
    for (const SideMisfits& side : sides)
      if (!side.is_empty()) misfit += side.best_line(side.slope_sign() * turn).misfit;
    if (misfit < best.misfit) best = {turn, misfit};
  }
  return best;
}

}  // namespace

std::vector<SideLine> measured_lines(const std::vector<SideToMeasure>& sides, double turn_sigma) {
  const auto places_of = [](double sigma_mm) {
    return 1 +
           static_cast<int>(std::lround((kLastPlaceMm + kLastPlaceSigmas * sigma_mm - kFirstPlaceMm) / kPlaceStepMm));
  };
  std::vector<SideMisfits> misfits(sides.begin(), sides.end());
  const auto fit_with = [&](double sigma_mm) {
    for (SideMisfits& side : misfits) side.look(kFirstPlaceMm, kPlaceStepMm, places_of(sigma_mm), sigma_mm);
    return best_turn(misfits, turn_sigma);
  };
  double penumbra_mm = kFirstPenumbraMm;
  Turned best = fit_with(penumbra_mm);
  // One penumbra fits best, and the nearer the better.
  for (const double ratio : {1.5, 1.22, 1.1, 1.05})
    for (const bool is_up : {true, false}) {
      bool is_better = true;
      while (is_better) {
        const double other_mm =
            std::clamp(is_up ? penumbra_mm * ratio : penumbra_mm / ratio, kLeastPenumbraMm, kMostPenumbraMm);
        const Turned other = fit_with(other_mm);
        is_better = other.misfit < best.misfit;
        if (is_better) {
          best = other;
          penumbra_mm = other_mm;
        }
      }
    }
  std::vector<SideLine> lines;
  for (SideMisfits& side : misfits) {
    SideLine line;
    if (side.is_empty()) {
      line.sigma_mm = line.scatter_mm = 1e3;
      lines.push_back(line);
      continue;
    }
    side.look(kFirstPlaceMm, kPlaceStepMm, places_of(penumbra_mm), penumbra_mm);
    const double slope = side.slope_sign() * best.turn;
    const auto coarse = side.best_line(slope);
    const std::vector<double> off = side.off_line(coarse.place_mm, slope);
    line.seen = static_cast<double>(off.size()) / side.blocks();
    line.scatter_mm = off.empty() ? 1e3 : 1.48 * median(off);
    line.misfit = std::exp(0.5 * coarse.misfit / side.blocks());
    line.wide_mm = side.reach_mm(coarse, slope);
    const double reach_mm = kPlaceStepMm * 1.2;
    side.look(coarse.place_mm - reach_mm - 1.0, kFinePlaceStepMm,
              1 + static_cast<int>(2.0 * (reach_mm + 1.0) / kFinePlaceStepMm), penumbra_mm);
    const auto fine = side.best_line(slope);
    line.at = side.at(fine.place_mm);
    line.slope = slope;
    line.middle = side.middle();
    // Blocks that are poorly explained scatter, and hardly count for the line.
    line.sigma_mm =
        std::hypot(std::min(line.scatter_mm, line.wide_mm) / std::sqrt(std::max(1.0, static_cast<double>(off.size()))),
                   kBestSigmaMm);
    lines.push_back(line);
  }
  return lines;
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
  return rises.empty() ? 0.0 : median(std::move(rises));
}

}  // namespace isoshift
