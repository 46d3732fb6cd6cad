#pragma once
// Siddon's walk: the cells of a unit lattice that a ray passes, in order, with entry and exit (Siddon, Med Phys 12,
// 1985).

#include <algorithm>
#include <cmath>
#include <limits>

#include "drr/cpu/cpu_renderer.h"

namespace isoshift {

// Calls visit(cell, t_begin, t_end) for every cell [c, c+1] with 0 <= c < size that the ray passes. The t of VoxelRay.
template <class Visit>
void walk_cells(const VoxelRay& ray, const Eigen::Vector3i& size, Visit&& visit) {
  const auto segment = clip_to_box(ray, Eigen::Vector3d::Zero(), size.cast<double>());
  if (!segment) return;

  Eigen::Vector3i cell, step;
  Eigen::Vector3d next_t, t_per_cell;
  for (int axis = 0; axis < 3; ++axis) {
    const double entry = ray.source[axis] + segment->begin * ray.way[axis];
    cell[axis] = std::clamp(static_cast<int>(std::floor(entry)), 0, size[axis] - 1);
    if (ray.way[axis] == 0.0) {
      step[axis] = 0;
      next_t[axis] = t_per_cell[axis] = std::numeric_limits<double>::infinity();
      continue;
    }
    step[axis] = ray.way[axis] > 0.0 ? 1 : -1;
    t_per_cell[axis] = 1.0 / std::abs(ray.way[axis]);
    next_t[axis] = (cell[axis] + (step[axis] > 0 ? 1 : 0) - ray.source[axis]) / ray.way[axis];
  }

  double t = segment->begin;
  while (t < segment->end) {
    int axis = 0;
    next_t.minCoeff(&axis);
    const double exit = std::min(next_t[axis], segment->end);
    if (exit > t) visit(cell, t, exit);
    t = std::max(t, exit);
    cell[axis] += step[axis];
    if (cell[axis] < 0 || cell[axis] >= size[axis]) return;
    next_t[axis] += t_per_cell[axis];
  }
}

}  // namespace isoshift
