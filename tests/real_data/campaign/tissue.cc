#include "tests/real_data/campaign/tissue.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace isoshift::campaign {
namespace {

using Eigen::Vector3d;

constexpr std::int16_t kAir = -1000, kBodyFrom = -350, kBoneFrom = 150;

// Calls `change` for every voxel whose center lies in a box.
template <class Change>
void for_each_in(Patient& patient, const Vector3d& low_mm, const Vector3d& high_mm, const Change& change) {
  const Eigen::Vector3i low =
      ((low_mm - patient.first_mm).cwiseQuotient(patient.spacing_mm)).array().ceil().cast<int>().max(0);
  const Eigen::Vector3i high = ((high_mm - patient.first_mm).cwiseQuotient(patient.spacing_mm))
                                   .array()
                                   .floor()
                                   .cast<int>()
                                   .min(patient.size.array() - 1);
  for (int k = low.z(); k <= high.z(); ++k)
    for (int j = low.y(); j <= high.y(); ++j)
      for (int i = low.x(); i <= high.x(); ++i) change(patient.at(i, j, k), patient.place_mm(i, j, k));
}

// Per slice: which voxels are air that is joined to the slice's edge.
std::vector<char> outer_air(const Patient& patient, int k) {
  const int columns = patient.size.x(), rows = patient.size.y();
  std::vector<char> outer(static_cast<std::size_t>(columns) * rows, 0);
  std::vector<int> open;
  const auto visit = [&](int i, int j) {
    if (i < 0 || j < 0 || i >= columns || j >= rows) return;
    char& seen = outer[static_cast<std::size_t>(j * columns + i)];
    if (seen != 0 || patient.at(i, j, k) >= kBodyFrom) return;
    seen = 1;
    open.push_back(j * columns + i);
  };
  for (int i = 0; i < columns; ++i) visit(i, 0), visit(i, rows - 1);
  for (int j = 0; j < rows; ++j) visit(0, j), visit(columns - 1, j);
  while (!open.empty()) {
    const int at = open.back(), i = at % columns, j = at / columns;
    open.pop_back();
    visit(i - 1, j);
    visit(i + 1, j);
    visit(i, j - 1);
    visit(i, j + 1);
  }
  return outer;
}

}  // namespace

void lose_weight(Patient& patient, double mm) {
  const int reach_x = static_cast<int>(mm / patient.spacing_mm.x()),
            reach_y = static_cast<int>(mm / patient.spacing_mm.y());
  const int columns = patient.size.x(), rows = patient.size.y();
  for (int k = 0; k < patient.size.z(); ++k) {
    const std::vector<char> outer = outer_air(patient, k);
    for (int j = 1; j + 1 < rows; ++j)
      for (int i = 1; i + 1 < columns; ++i) {
        const auto is_outer = [&](int x, int y) { return outer[static_cast<std::size_t>(y * columns + x)] != 0; };
        // Air at the edge of the body takes away what lies around it.
        if (!is_outer(i, j) || (is_outer(i - 1, j) && is_outer(i + 1, j) && is_outer(i, j - 1) && is_outer(i, j + 1)))
          continue;
        for (int y = std::max(0, j - reach_y); y <= std::min(rows - 1, j + reach_y); ++y)
          for (int x = std::max(0, i - reach_x); x <= std::min(columns - 1, i + reach_x); ++x)
            if (std::hypot((x - i) * patient.spacing_mm.x(), (y - j) * patient.spacing_mm.y()) <= mm &&
                patient.at(x, y, k) < kBoneFrom)
              patient.at(x, y, k) = kAir;
      }
  }
}

void put_gas(Patient& patient, const Vector3d& center_mm, const Vector3d& half_extent_mm) {
  for_each_in(patient, center_mm - half_extent_mm, center_mm + half_extent_mm,
              [&](std::int16_t& hu, const Vector3d& place_mm) {
                if ((place_mm - center_mm).cwiseQuotient(half_extent_mm).norm() < 1.0 && hu < kBoneFrom) hu = kAir;
              });
}

void put_effusion(Patient& patient, double behind_mm) {
  for (int k = 0; k < patient.size.z(); ++k) {
    const std::vector<char> outer = outer_air(patient, k);
    for (int j = 0; j < patient.size.y(); ++j)
      for (int i = 0; i < patient.size.x(); ++i)
        if (patient.place_mm(i, j, k).y() > behind_mm && patient.at(i, j, k) < kBodyFrom &&
            outer[static_cast<std::size_t>(j * patient.size.x() + i)] == 0)
          patient.at(i, j, k) = 10;
  }
}

void clear_outside(Patient& patient, const Vector3d& low_mm, const Vector3d& high_mm) {
  const Vector3d all = Vector3d::Constant(1e4);
  for_each_in(patient, -all, all, [&](std::int16_t& hu, const Vector3d& place_mm) {
    if ((place_mm.array() < low_mm.array()).any() || (place_mm.array() > high_mm.array()).any()) hu = kAir;
  });
}

void put_metal(Patient& patient, const Vector3d& begin_mm, const Vector3d& end_mm, double radius_mm) {
  constexpr std::int16_t kMetal = 8000;
  const Vector3d way = end_mm - begin_mm, margin = Vector3d::Constant(radius_mm);
  for_each_in(patient, begin_mm.cwiseMin(end_mm) - margin, begin_mm.cwiseMax(end_mm) + margin,
              [&](std::int16_t& hu, const Vector3d& place_mm) {
                const double share = std::clamp((place_mm - begin_mm).dot(way) / way.squaredNorm(), 0.0, 1.0);
                if ((place_mm - begin_mm - share * way).norm() <= radius_mm) hu = kMetal;
              });
}

}  // namespace isoshift::campaign
