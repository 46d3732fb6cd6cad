#include "bodies/spine_line.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "base/parallel.h"

namespace isoshift {
namespace {

constexpr double kCellMm = 4.0;  // of the search, about

// How much of bone a value is: 0 up to muscle, 1 from 250 HU on, so that contrast agent outweighs no spongy bone.
float bone_share(float hu) { return std::clamp((hu - 60.0F) / 190.0F, 0.0F, 1.0F); }

// Bone, averaged over cells and then over the slices within 8 mm.
Volume<float> bone_in_cells(const Volume<float>& hu, int step) {
  const Eigen::Vector3i size = hu.size / step;
  Volume<float> cells(size, hu.patient_from_voxel), mean(size, hu.patient_from_voxel);
  const float share = 1.0F / static_cast<float>(step * step * step);
  parallel_for(0, size.z(), [&](int k) {
    for (int z = 0; z < step; ++z)
      for (int j = 0; j < size.y() * step; ++j)
        for (int i = 0; i < size.x() * step; ++i)
          cells.at(i / step, j / step, k) += share * bone_share(hu.at(i, j, k * step + z));
  });
  const int around = static_cast<int>(std::lround(8.0 / (hu.spacing_mm().x() * step)));
  parallel_for(0, size.z(), [&](int k) {
    const int first = std::max(0, k - around), last = std::min(size.z() - 1, k + around);
    for (int z = first; z <= last; ++z)
      for (std::size_t n = mean.index(0, 0, k), m = cells.index(0, 0, z); n < mean.index(0, 0, k + 1); ++n, ++m)
        mean.voxels[n] += cells.voxels[m] / static_cast<float>(last - first + 1);
  });
  return mean;
}

// Means over boxes of one slice, each in constant time.
class SliceMeans {
 public:
  SliceMeans(const Volume<float>& values, int k, double cell_mm)
      : columns_(values.size.x()),
        rows_(values.size.y()),
        cell_mm_(cell_mm),
        sums_(static_cast<std::size_t>(columns_ + 1) * (rows_ + 1), 0.0) {
    for (int j = 0; j < rows_; ++j) {
      double row = 0.0;
      for (int i = 0; i < columns_; ++i) {
        row += values.at(i, j, k);
        sums_[index(i + 1, j + 1)] = sums_[index(i + 1, j)] + row;
      }
    }
  }

  // Sum over the cells of a box about a cell, mm to the sides and from front to back; what lies outside counts as 0.
  double sum(int i, int j, double aside_mm, double front_mm, double back_mm, double* area) const {
    const double left = i - aside_mm / cell_mm_, right = i + aside_mm / cell_mm_ + 1;
    const double front = j + front_mm / cell_mm_, back = j + back_mm / cell_mm_ + 1;
    const auto clamped = [](double at, int most) {  // rounded; std::lround() took half of the time
      return static_cast<int>(std::clamp(at + 0.5, 0.0, static_cast<double>(most)));
    };
    const int a = clamped(left, columns_), b = clamped(right, columns_);
    const int c = clamped(front, rows_), d = clamped(back, rows_);
    *area = (right - left) * (back - front);
    return sums_[index(b, d)] - sums_[index(a, d)] - sums_[index(b, c)] + sums_[index(a, c)];
  }
  double mean(int i, int j, double aside_mm, double front_mm, double back_mm) const {
    double area = 1.0;
    const double all = sum(i, j, aside_mm, front_mm, back_mm, &area);
    return all / std::max(1.0, area);
  }
  // Within `radius_mm`: two crossed boxes.
  double around(int i, int j, double radius_mm) const {
    const double less = 0.6 * radius_mm;
    return 0.5 * (mean(i, j, radius_mm, -less, less) + mean(i, j, less, -radius_mm, radius_mm));
  }

 private:
  std::size_t index(int i, int j) const { return static_cast<std::size_t>(j) * (columns_ + 1) + i; }
  int columns_, rows_;
  double cell_mm_;
  std::vector<double> sums_;
};

double saturated(double share, double at) { return 1.0 - std::exp(-share / at); }

// 0 and more where a cell looks like the middle of a vertebral body. What lies beyond the spinous process counts
// against it: an aorta with contrast agent has the spine behind it.
double body_canal_arch(const SliceMeans& slice, int i, int j) {
  double most = -1.0;
  for (const double canal_mm : {12.0, 15.0, 18.0, 21.0, 24.0, 27.0}) {  // from the middle of body to that of the canal
    const double body = slice.around(i, j, canal_mm - 7.0);
    const double canal = slice.mean(i, j, 4.0, canal_mm - 2.0, canal_mm + 2.0);
    const double arch = slice.mean(i, j, 6.0, canal_mm + 8.0, canal_mm + 28.0);
    const double front = slice.mean(i, j, 5.0, -(canal_mm + 6.0), -(canal_mm - 3.0));
    const double beyond = slice.mean(i, j, 10.0, canal_mm + 46.0, canal_mm + 76.0);
    most = std::max(most, saturated(body, 0.5) * saturated(arch, 0.3) - 0.5 * canal - 0.2 * front - 2.0 * beyond);
  }
  return most - 0.3;
}

double body_alone(const SliceMeans& slice, int i, int j) {
  double most = -1.0;
  for (const double radius_mm : {6.0, 9.0, 12.0}) {
    double inner_area = 0.0, outer_area = 0.0;
    const double near = radius_mm + 4.0, far = radius_mm + 12.0;
    const double inner = slice.sum(i, j, near, -near, near, &inner_area);
    const double outer = slice.sum(i, j, far, -far, far, &outer_area);
    const double ring = (outer - inner) / (outer_area - inner_area);
    most = std::max(most, saturated(slice.around(i, j, radius_mm), 0.5) - 2.0 * ring);
  }
  return most - 0.45;
}

// The middle column of what is denser than -300 HU, of each slice of cells.
std::vector<double> middle_columns(const Volume<float>& hu, const Eigen::Vector3i& size, int step) {
  std::vector<double> middles(size.z());
  parallel_for(0, size.z(), [&](int k) {
    double sum = 0.0, count = 1e-9;
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i)
        if (hu.at(i * step, j * step, k * step) > -300.0F) sum += i, ++count;
    middles[k] = sum / count;
  });
  return middles;
}

// The path with the greatest sum of scores, from any slice to any higher one, by a cell at most to the next slice
// (45 degrees). Returns its cells from the feet to the head.
std::vector<Eigen::Vector3i> best_path(const Volume<float>& score) {
  constexpr float kCostPerCell = 0.05F;
  const Eigen::Vector3i& size = score.size;
  const std::size_t slice = static_cast<std::size_t>(size.x()) * size.y();
  Volume<float> best = score;
  Volume<std::int8_t> from(size, score.patient_from_voxel, -1);  // which of the nine cells below; -1: the path begins
  for (int k = 1; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) {
        float most = 0.0F;
        for (int n = 0; n < 9; ++n) {
          const int x = i + n % 3 - 1, y = j + n / 3 - 1;
          if (x < 0 || y < 0 || x >= size.x() || y >= size.y()) continue;
          const float value =
              best.at(x, y, k - 1) - kCostPerCell * static_cast<float>(std::abs(x - i) + std::abs(y - j));
          if (value > most) {
            most = value;
            from.at(i, j, k) = static_cast<std::int8_t>(n);
          }
        }
        best.at(i, j, k) += most;
      }
  const auto end = std::ranges::max_element(best.voxels);
  if (*end <= 0.0F) return {};
  const auto n = static_cast<std::size_t>(end - best.voxels.begin());
  Eigen::Vector3i at(static_cast<int>(n % size.x()), static_cast<int>(n % slice / size.x()),
                     static_cast<int>(n / slice));
  std::vector<Eigen::Vector3i> path = {at};
  for (;;) {
    const std::int8_t step = from.at(at.x(), at.y(), at.z());
    if (step < 0) break;
    at += Eigen::Vector3i(step % 3 - 1, step / 3 - 1, -1);
    path.push_back(at);
  }
  std::ranges::reverse(path);
  return path;
}

}  // namespace

std::vector<Eigen::Vector3d> find_spine_line(const Volume<float>& hu, SpineSigns signs) {
  const double edge_mm = hu.spacing_mm().x();
  const int step = std::max(1, static_cast<int>(std::lround(kCellMm / edge_mm)));
  const Eigen::Vector3i size = hu.size / step;
  if ((size.array() < 3).any()) return {};
  const double cell_mm = edge_mm * step;
  const Volume<float> bone = bone_in_cells(hu, step);
  const std::vector<double> middles = middle_columns(hu, size, step);
  Volume<float> score(size, hu.patient_from_voxel);
  parallel_for(0, size.z(), [&](int k) {
    const SliceMeans slice(bone, k, cell_mm);
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) {
        constexpr double kAsideMm = 60.0, kAsideCost = 0.3;
        const double aside = (i - middles[k]) * cell_mm / kAsideMm;
        const double looks = signs == SpineSigns::kBodyAlone ? body_alone(slice, i, j) : body_canal_arch(slice, i, j);
        score.at(i, j, k) = static_cast<float>(looks - kAsideCost * aside * aside);
      }
  });
  std::vector<Eigen::Vector3d> line;
  for (const Eigen::Vector3i& cell : best_path(score))
    line.emplace_back(hu.patient_from_voxel * ((cell.cast<double>().array() + 0.5) * step - 0.5).matrix().eval());
  return line;
}

}  // namespace isoshift
