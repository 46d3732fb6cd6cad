#include "geometry/mask.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"

namespace isoshift {
namespace {

// Voxels begin to end - 1 of a row.
struct Run {
  int begin = 0;
  int end = 0;
};

// The voxels of one row of the ball of offsets: those from (first, j, k) to (last, j, k).
struct BallRow {
  int j = 0, k = 0;
  int first = 0, last = 0;
};

// All offsets (i, j, k) with |axes (i, j, k)| <= margin, row by row; none reaches beyond the volume.
std::vector<BallRow> ball_of(double margin_mm, const Eigen::Matrix3d& axes, const Eigen::Vector3i& size) {
  // Within a ball, coordinate n is at most the radius times the norm of row n of the inverse.
  const Eigen::Vector3d reach = margin_mm * axes.inverse().rowwise().norm();
  const Eigen::Vector3i most = reach.cwiseMin(size.cast<double>()).array().floor().cast<int>();
  std::vector<BallRow> rows;
  for (int k = -most.z(); k <= most.z(); ++k)
    for (int j = -most.y(); j <= most.y(); ++j) {
      // |axis i + rest|^2 <= margin^2, a quadratic in i.
      const Eigen::Vector3d axis = axes.col(0), rest = j * axes.col(1) + k * axes.col(2);
      const double middle = -axis.dot(rest) / axis.squaredNorm();
      const double room_mm2 = margin_mm * margin_mm - (rest + middle * axis).squaredNorm();
      if (room_mm2 < 0.0) continue;
      const double half = std::sqrt(room_mm2) / axis.norm();
      const auto bounded = [&](double i) { return static_cast<int>(std::clamp<double>(i, -size.x(), size.x())); };
      if (const BallRow row{j, k, bounded(std::ceil(middle - half)), bounded(std::floor(middle + half))};
          row.first <= row.last)
        rows.push_back(row);
    }
  return rows;
}

}  // namespace

// Row by row with runs of voxels instead of a distance transform: that needs no volume of distances and asks for no
// orthogonal axes. A row of the result is the union of the runs of all rows within reach, each made longer by the
// ball's row between them.
Volume<std::uint8_t> dilated(const Volume<std::uint8_t>& mask, double margin_mm) {
  if (!(margin_mm >= 0.0 && std::isfinite(margin_mm)))
    throw UsageError("a margin of " + std::to_string(margin_mm) + " mm: expected a finite number, 0 or more");
  // A voxel that lies exactly at the margin is within it, whatever rounding says.
  constexpr double kRoundingMm = 1e-6;
  const std::vector<BallRow> ball = ball_of(margin_mm + kRoundingMm, mask.patient_from_voxel.linear(), mask.size);

  const Eigen::Vector3i& size = mask.size;
  std::vector<Run> runs;
  std::vector<std::size_t> first_run = {0};                 // of every row, and the end of the last
  Eigen::Array2i lowest = size.tail<2>(), highest(-1, -1);  // j and k of rows that have runs
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j) {
      const auto row = mask.voxels.begin() + static_cast<std::ptrdiff_t>(mask.index(0, j, k));
      const auto end = row + size.x();
      for (auto begin = std::find(row, end, 1); begin != end;) {
        const auto after = std::find(begin, end, 0);
        runs.push_back({static_cast<int>(begin - row), static_cast<int>(after - row)});
        begin = std::find(after, end, 1);
      }
      if (runs.size() > first_run.back()) {
        lowest = lowest.min(Eigen::Array2i(j, k));
        highest = highest.max(Eigen::Array2i(j, k));
      }
      first_run.push_back(runs.size());
    }

  Volume<std::uint8_t> result(size, mask.patient_from_voxel);
  std::vector<int> change(static_cast<std::size_t>(size.x()) + 1);  // of the number of runs that cover a voxel
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j) {
      std::ranges::fill(change, 0);
      for (const BallRow& row : ball) {
        const Eigen::Array2i from(j - row.j, k - row.k);
        if ((from < lowest).any() || (from > highest).any()) continue;
        const std::size_t n = static_cast<std::size_t>(from.y()) * size.y() + from.x();
        for (std::size_t r = first_run[n]; r < first_run[n + 1]; ++r) {
          ++change[std::clamp(runs[r].begin + row.first, 0, size.x())];
          --change[std::clamp(runs[r].end + row.last, 0, size.x())];
        }
      }
      int covering = 0;
      for (int i = 0; i < size.x(); ++i) result.at(i, j, k) = (covering += change[i]) > 0 ? 1 : 0;
    }
  return result;
}

Eigen::Vector3d centroid_patient_mm(const Volume<std::uint8_t>& mask) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double count = 0.0;
  for (int k = 0; k < mask.size.z(); ++k)
    for (int j = 0; j < mask.size.y(); ++j)
      for (int i = 0; i < mask.size.x(); ++i)
        if (mask.at(i, j, k) != 0) {
          sum += Eigen::Vector3d(i, j, k);
          ++count;
        }
  return mask.patient_from_voxel * (sum / count).eval();
}

double distance_mm(const Volume<std::uint8_t>& mask, const Eigen::Vector3d& point_patient_mm) {
  double nearest_mm = INFINITY;
  for (int k = 0; k < mask.size.z(); ++k)
    for (int j = 0; j < mask.size.y(); ++j)
      for (int i = 0; i < mask.size.x(); ++i)
        if (mask.at(i, j, k) != 0)
          nearest_mm =
              std::min(nearest_mm, (mask.patient_from_voxel * Eigen::Vector3d(i, j, k) - point_patient_mm).norm());
  return nearest_mm;
}

}  // namespace isoshift
