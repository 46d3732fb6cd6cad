#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>

#include "geometry/xray_view.h"

namespace isoshift {

// Where a view shows a point of the room: (column, row), or nothing.
using Projection = std::function<std::optional<Eigen::Vector2d>(const Eigen::Vector3d& point_room_mm)>;

// How a view shows points that move: two rows per point, pixels per mm of a translation and per rad of a rotation
// vector about the isocenter. The rows of a point that it does not show are 0.
using SeenMotions = Eigen::Matrix<double, Eigen::Dynamic, 6>;
SeenMotions seen_motions(const Projection& projection, std::span<const Eigen::Vector3d> points_room_mm);

SeenMotions seen_motions(const XrayView& view, std::span<const Eigen::Vector3d> points_room_mm);

}  // namespace isoshift
