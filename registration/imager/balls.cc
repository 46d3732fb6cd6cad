#include "registration/imager/balls.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "base/error.h"
#include "base/median.h"
#include "geometry/linear_algebra.h"
#include "registration/preprocess/image_operations.h"
#include "registration/preprocess/preprocess.h"

namespace isoshift {
namespace {

// Voxels from low to high, bounds included.
struct Block {
  Eigen::Vector3i low, high;

  void include(const Eigen::Vector3i& voxel) {
    low = low.cwiseMin(voxel);
    high = high.cwiseMax(voxel);
  }
};

constexpr std::array<std::array<int, 3>, 6> kNeighbors = {
    {{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};

// The blocks of the connected parts above a value.
std::vector<Block> dense_parts(const Volume<float>& hu, float above) {
  std::vector<bool> seen(hu.voxels.size(), false);
  std::vector<Block> parts;
  std::vector<Eigen::Vector3i> open;
  const auto visit = [&](const Eigen::Vector3i& voxel) {
    const std::size_t n = hu.index(voxel.x(), voxel.y(), voxel.z());
    if (seen[n] || hu.voxels[n] <= above) return false;
    seen[n] = true;
    open.push_back(voxel);
    return true;
  };
  for (int k = 0; k < hu.size.z(); ++k)
    for (int j = 0; j < hu.size.y(); ++j)
      for (int i = 0; i < hu.size.x(); ++i) {
        const Eigen::Vector3i seed(i, j, k);
        if (!visit(seed)) continue;
        Block part{seed, seed};
        while (!open.empty()) {
          const Eigen::Vector3i voxel = open.back();
          open.pop_back();
          part.include(voxel);
          for (const auto& step : kNeighbors) {
            const Eigen::Vector3i next = voxel + Eigen::Vector3i(step[0], step[1], step[2]);
            if ((next.array() >= 0).all() && (next.array() < hu.size.array()).all()) visit(next);
          }
        }
        parts.push_back(part);
      }
  return parts;
}

// Center of mass above the values around the part, and the radius of a ball of that mass.
Ball ball_of(const Volume<float>& hu, const Block& part) {
  constexpr int kAround = 2;
  const Eigen::Vector3i low = (part.low.array() - kAround).cwiseMax(0);
  const Eigen::Vector3i high = (part.high.array() + kAround).min(hu.size.array() - 1);
  std::vector<double> rim;
  float densest = 0.0F;
  const auto for_each = [&](const auto& act) {
    for (int k = low.z(); k <= high.z(); ++k)
      for (int j = low.y(); j <= high.y(); ++j)
        for (int i = low.x(); i <= high.x(); ++i) act(Eigen::Vector3i(i, j, k), hu.at(i, j, k));
  };
  for_each([&](const Eigen::Vector3i& voxel, float value) {
    densest = std::max(densest, value);
    if ((voxel.array() == low.array()).any() || (voxel.array() == high.array()).any()) rim.push_back(value);
  });
  const double around = median(rim);
  double mass = 0.0;
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  for_each([&](const Eigen::Vector3i& voxel, float value) {
    const double weight = std::max(0.0, value - around);
    mass += weight;
    moment += weight * voxel.cast<double>();
  });
  const double volume_mm3 = mass / (densest - around) * std::abs(hu.patient_from_voxel.linear().determinant());
  return {.center_patient_mm = hu.patient_from_voxel * Eigen::Vector3d(moment / mass),
          .radius_mm = std::cbrt(0.75 * volume_mm3 / std::numbers::pi)};
}

bool is_round(const Volume<float>& hu, const Block& part) {
  constexpr double kMostDifference = 0.3, kVoxels = 2.0;
  const Eigen::Vector3d spacing = hu.spacing_mm();
  const Eigen::Vector3d extent = (part.high - part.low + Eigen::Vector3i::Ones()).cast<double>().cwiseProduct(spacing);
  return extent.maxCoeff() - extent.minCoeff() <=
         std::max(kMostDifference * extent.maxCoeff(), kVoxels * spacing.maxCoeff());
}

// What lies around a spot: a plane, value + slope . (pixel - place).
struct Background {
  double value = 0.0;
  Eigen::Vector2d slope = Eigen::Vector2d::Zero();
};

// Calls act(column, row, offset from the place) for all pixels within a distance.
template <class Act>
void for_each_within(const Image<float>& image, const Eigen::Vector2d& place, double distance_px, const Act& act) {
  const int column0 = static_cast<int>(std::lround(place.x())), row0 = static_cast<int>(std::lround(place.y()));
  const int reach = static_cast<int>(std::ceil(distance_px)) + 1;
  for (int row = std::max(0, row0 - reach); row <= std::min(image.rows - 1, row0 + reach); ++row)
    for (int column = std::max(0, column0 - reach); column <= std::min(image.columns - 1, column0 + reach); ++column)
      act(column, row, Eigen::Vector2d(column, row) - place);
}

// From the pixels of the ring between two distances, without those that stand out, such as other balls. The path
// through the phantom changes quickly beside its edges: with a level background a ball lay up to a quarter of a
// millimeter off.
std::optional<Background> background_of(const Image<float>& image, const Eigen::Vector2d& place, double from_px,
                                        double to_px) {
  constexpr int kRounds = 4;
  constexpr double kNoises = 2.5, kNormal = 1.4826;
  constexpr std::size_t kLeast = 12;
  std::vector<Eigen::Vector3d> rows;
  std::vector<double> values;
  for_each_within(image, place, to_px, [&](int column, int row, const Eigen::Vector2d& offset) {
    if (offset.norm() < from_px || offset.norm() > to_px) return;
    rows.emplace_back(1.0, offset.x(), offset.y());
    values.push_back(image.at(column, row));
  });
  if (rows.size() < kLeast) return std::nullopt;
  Eigen::Vector3d plane(median(values), 0.0, 0.0);
  for (int round = 0; round < kRounds; ++round) {
    std::vector<double> apart;
    apart.reserve(rows.size());
    for (std::size_t n = 0; n < rows.size(); ++n) apart.push_back(std::abs(values[n] - rows[n].dot(plane)));
    const double most = kNoises * kNormal * median(apart);
    Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    for (std::size_t n = 0; n < rows.size(); ++n) {
      if (apart[n] > most) continue;
      normal += rows[n] * rows[n].transpose();
      right += values[n] * rows[n];
    }
    const Eigen::VectorXd sizes = symmetric_eigen(normal).values;
    if (!(sizes[0] > 1e-12 * sizes[2])) return std::nullopt;
    plane = solve_symmetric(normal, right);
  }
  return Background{.value = plane[0], .slope = plane.tail<2>()};
}

// Center of mass of the disc of 1.4 radii about a place, above what lies around it.
Eigen::Vector2d center_of_mass(const Image<float>& image, Eigen::Vector2d place, double radius_px) {
  constexpr double kDisc = 1.4, kRingFrom = 1.5, kRingTo = 2.5;
  constexpr int kRounds = 8;
  for (int round = 0; round < kRounds; ++round) {
    const auto around = background_of(image, place, kRingFrom * radius_px, kRingTo * radius_px);
    if (!around) return place;
    double mass = 0.0;
    Eigen::Vector2d moment = Eigen::Vector2d::Zero();
    for_each_within(image, place, kDisc * radius_px, [&](int column, int row, const Eigen::Vector2d& offset) {
      // Pixels on the disc's edge count in part, so that the center does not jump from pixel to pixel.
      const double inside = std::clamp(kDisc * radius_px - offset.norm() + 0.5, 0.0, 1.0);
      const double weight = inside * (image.at(column, row) - around->value - around->slope.dot(offset));
      mass += weight;
      moment += weight * offset;
    });
    if (!(mass > 0.0)) return place;
    const Eigen::Vector2d step = moment / mass;
    if (!(step.norm() < radius_px)) return place;
    place += step;
  }
  return place;
}

}  // namespace

std::vector<Ball> balls_in(const Volume<float>& hu) {
  constexpr double kLeastMm = 1.0, kMostMm = 10.0;
  constexpr float kDenserThanBone = 2000.0F;
  const float densest = *std::ranges::max_element(hu.voxels);
  if (densest < kDenserThanBone)
    throw Error(fmt::format("the CT's densest voxel has {:.0f} HU: it holds no metal balls (more than {:.0f} HU)",
                            densest, kDenserThanBone));
  std::vector<Ball> balls;
  for (const Block& part : dense_parts(hu, 0.5F * densest)) {
    const Ball ball = ball_of(hu, part);
    if (!is_round(hu, part) || ball.radius_mm < kLeastMm || ball.radius_mm > kMostMm)
      throw Error(fmt::format(
          "the CT holds a dense part at ({:.1f}, {:.1f}, {:.1f}) mm that is no ball of {:g} to "
          "{:g} mm radius: a phantom with metal balls and nothing else as dense is needed",
          ball.center_patient_mm.x(), ball.center_patient_mm.y(), ball.center_patient_mm.z(), kLeastMm, kMostMm));
    balls.push_back(ball);
  }
  return balls;
}

DarkSpots dark_spots(const XrayImage& xray, double radius_px) {
  // Radii: sigma of what counts as around. A small field's rim, which is darker than any ball, must not.
  constexpr double kSurroundings = 1.0;
  constexpr double kNoises = 6.0, kNormal = 1.4826, kNoisePx = 1.0, kShareOfDarkest = 0.3;
  FixedImage image = prepare(xray);
  const Image<float> fine = high_pass(image.line_integral, kSurroundings * radius_px);
  const Image<float> noise = high_pass(image.line_integral, kNoisePx);
  std::vector<double> noises;
  double darkest = 0.0;
  for (std::size_t n = 0; n < fine.pixels.size(); ++n) {
    if (image.field.pixels[n] == 0) continue;
    noises.push_back(std::abs(noise.pixels[n]));
    darkest = std::max(darkest, static_cast<double>(fine.pixels[n]));
  }
  DarkSpots spots;
  if (noises.empty()) return spots;
  const double least = std::max(kNoises * kNormal * median(noises), kShareOfDarkest * darkest);
  const int reach = std::max(1, static_cast<int>(std::lround(radius_px)));
  for (int row = reach; row < fine.rows - reach; ++row)
    for (int column = reach; column < fine.columns - reach; ++column) {
      const float top = fine.at(column, row);
      if (top < least || image.field.at(column, row) == 0) continue;
      bool is_top = true;
      for (int r = row - reach; r <= row + reach && is_top; ++r)
        for (int c = column - reach; c <= column + reach && is_top; ++c)
          is_top = fine.at(c, r) < top || (c == column && r == row) ||
                   (fine.at(c, r) == top && std::pair(r, c) > std::pair(row, column));
      if (is_top) spots.places.push_back(center_of_mass(image.line_integral, Eigen::Vector2d(column, row), radius_px));
    }
  spots.field = std::move(image.field);
  return spots;
}

}  // namespace isoshift
