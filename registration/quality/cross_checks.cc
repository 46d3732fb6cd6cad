#include "registration/quality/cross_checks.h"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "geometry/rotation.h"
#include "registration/pose_parameters.h"

namespace isoshift {
namespace {

constexpr double kMinDisplacementMm = 10.0;  // what ends nearer to the pose found is the same vertebra

// From displaced poses back to the nearest good one: gradients of pixels twice as large, then the last stage.
std::vector<Stage> stages_from(const SearchOptions& options) {
  Stage wide = options.stages.back();
  wide.pixel_mm *= 2.0;
  wide.voxel_mm *= 2.0;
  wide.initial_step_mm = 3.0;
  wide.initial_step_rad = rad_from_deg(1.0);
  wide.relative_tolerance = 0.05;
  return {wide, options.stages.back()};
}

}  // namespace

std::vector<LeftOutView> leave_out_views(const RendererPyramid& renderers, const FixedViews& views,
                                         const Eigen::Isometry3d& start_room_from_patient, const SearchOptions& options,
                                         const SearchResult& found) {
  std::vector<LeftOutView> left_out;
  if (views.images.size() < 3) return left_out;
  SearchOptions last_stage = options;
  last_stage.stages = {options.stages.back()};
  last_stage.parameters = found.parameters;
  for (std::size_t view = 0; view < views.images.size(); ++view) {
    FixedViews others = views;
    others.images.erase(others.images.begin() + static_cast<std::ptrdiff_t>(view));
    const SearchResult without = search(renderers, others, start_room_from_patient, last_stage);
    const PoseDistance distance = distance_between(without.parameters, found.parameters);
    left_out.push_back({.distance_mm = distance.translation_mm, .angle_rad = distance.angle_rad});
  }
  return left_out;
}

std::vector<Alternative> compare_vertebrae(const RendererPyramid& renderers, const FixedViews& views,
                                           const Eigen::Isometry3d& start_room_from_patient,
                                           const SearchOptions& options, const SearchResult& found) {
  const std::vector<Stage> stages = stages_from(options);
  const Eigen::Isometry3d pose = setup_error_from_parameters(found.parameters) * start_room_from_patient;
  const Eigen::Vector3d headward_room = pose.linear() * Eigen::Vector3d::UnitZ();
  std::vector<Alternative> alternatives;
  for (const double direction : {-1.0, 1.0}) {
    std::optional<Alternative> best;
    for (const double distance_mm : {20.0, 26.0, 32.0, 38.0}) {
      SearchOptions displaced = options;
      displaced.stages = stages;
      displaced.parameters = found.parameters;
      for (int axis = 0; axis < 3; ++axis)
        displaced.parameters[static_cast<std::size_t>(axis)] += direction * distance_mm * headward_room[axis];
      for (std::size_t axis = 0; axis < 3; ++axis)
        displaced.bound_mm = std::max(displaced.bound_mm, std::abs(displaced.parameters[axis]) + 10.0);
      const auto there = search_if_possible(renderers, views, start_room_from_patient, displaced);
      if (!there) continue;  // moved so far, the region may leave the field
      const double moved_mm =
          headward_room.dot(Eigen::Vector3d(there->parameters.data()) - Eigen::Vector3d(found.parameters.data()));
      const double similarity = there->stages.back().value;
      if (std::abs(moved_mm) < kMinDisplacementMm || (best && best->similarity >= similarity)) continue;
      best = Alternative{.description = fmt::format("the patient {:.0f} mm further to the {}", std::abs(moved_mm),
                                                    moved_mm > 0.0 ? "head" : "feet"),
                         .similarity = similarity,
                         .as_is = found.stages.back().value,
                         .distance_mm = std::abs(moved_mm)};
    }
    if (best) alternatives.push_back(*best);
  }
  return alternatives;
}

}  // namespace isoshift
