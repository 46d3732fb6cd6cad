#include "registration/bodies/target_match.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "registration/similarity/tiles.h"

namespace isoshift {
namespace {

using Eigen::Vector3d;

constexpr double kPixelMm = 4.0, kReachMm = 40.0, kPartMm = 12.0;
constexpr std::ptrdiff_t kLeastPixels = 200;
constexpr std::size_t kLeastPixelsOfAPart = 6;

std::vector<FixedImage> surroundings(const FixedViews& views, const Eigen::Isometry3d& about,
                                     const Vector3d& target_room_mm) {
  std::vector<FixedImage> level = views.reduced_to(kPixelMm, about, 0.0);
  for (FixedImage& image : level) {
    const auto center = image.view.project(target_room_mm);
    Image<std::uint8_t> near = image.field;
    for (int row = 0; row < near.rows; ++row)
      for (int column = 0; column < near.columns; ++column)
        if (!center || (Eigen::Vector2d(column, row) - *center).norm() > kReachMm * pixels_per_mm(image.view))
          near.at(column, row) = 0;
    if (std::ranges::count(near.pixels, 1) >= kLeastPixels) image.field = std::move(near);
  }
  return level;
}

// Centered.
Eigen::VectorXd values_of(const std::vector<float>& all, const std::vector<std::uint32_t>& numbers) {
  Eigen::VectorXd values(static_cast<Eigen::Index>(numbers.size()));
  for (std::size_t n = 0; n < numbers.size(); ++n) values[static_cast<Eigen::Index>(n)] = all[numbers[n]];
  return values.array() - values.mean();
}

// Of pairs of value and weight.
double weighted_median(std::vector<std::pair<double, double>> values) {
  std::ranges::sort(values);
  double all = 0.0, below = 0.0;
  for (const auto& [value, weight] : values) all += weight;
  for (const auto& [value, weight] : values) {
    below += weight;
    if (below > 0.5 * all) return value;
  }
  return 0.0;
}

double match_of_parts(const XrayView& view, std::span<const std::uint32_t> compared, const Gradients& xray,
                      const Gradients& drr) {
  std::vector<std::pair<double, double>> correlations;
  for (const Tile& part : tiles_of(view, compared, kPartMm)) {
    if (part.compared.size() < kLeastPixelsOfAPart) continue;
    for (const auto direction : {&Gradients::along_row, &Gradients::along_column}) {
      const Eigen::VectorXd there = values_of(xray.*direction, part.compared),
                            here = values_of(drr.*direction, part.compared);
      const double norms = there.norm() * here.norm();
      correlations.emplace_back(norms > 0.0 ? there.dot(here) / norms : 0.0, here.norm());
    }
  }
  return weighted_median(std::move(correlations));
}

// Of the line integrals, by view, of the pixels that `pixels` renders.
TargetMatch match_of(const Objective& pixels, std::span<const std::vector<float>> drrs) {
  const double share = 1.0 / static_cast<double>(drrs.size());
  TargetMatch match;
  for (std::size_t view = 0; view < drrs.size(); ++view) {
    const Comparison& comparison = pixels.comparison(view);
    const std::vector<float>& drr = drrs[view];
    match.of_all += share * comparison.of(drr);
    match.of_parts += share * match_of_parts(pixels.views()[view], pixels.compared_pixels(view),
                                             comparison.xray_gradients(), gradients(drr, comparison.neighbors()));
  }
  return match;
}

TargetMatch match_of_whole(std::span<const FixedImage> level, Renderer& renderer,
                           const Eigen::Isometry3d& room_from_patient) {
  Objective pixels(renderer, level, room_from_patient, {.similarity = SimilarityKind::kGradientCorrelation});
  const RenderResult rendered = pixels.render(std::span(&room_from_patient, 1));
  std::vector<std::vector<float>> drrs;
  drrs.reserve(level.size());
  for (std::size_t view = 0; view < level.size(); ++view) {
    const auto drr = rendered.line_integrals(0, view);
    drrs.emplace_back(drr.begin(), drr.end());
  }
  return match_of(pixels, drrs);
}

}  // namespace

TargetMatch match_near_target(const BodyScene& scene, const Vector3d& target_room_mm, const BodyPoses& poses) {
  const std::vector<FixedImage> level = surroundings(scene.views, scene.whole_room_from_patient, target_room_mm);
  const Objective pixels(*scene.fine.as_one, level, poses.front().front(),
                         {.similarity = SimilarityKind::kGradientCorrelation});
  std::vector<std::vector<float>> drrs;
  drrs.reserve(level.size());
  for (std::size_t view = 0; view < level.size(); ++view)
    drrs.push_back(scene.fine.line_integrals(pixels, poses, view));
  return match_of(pixels, drrs);
}

TargetMatch match_near_target(const FixedViews& views, Renderer& renderer, const Eigen::Isometry3d& room_from_patient,
                              const Vector3d& target_room_mm) {
  return match_of_whole(surroundings(views, room_from_patient, target_room_mm), renderer, room_from_patient);
}

TargetMatch match_everywhere(const FixedViews& views, Renderer& renderer, const Eigen::Isometry3d& room_from_patient) {
  return match_of_whole(views.reduced_to(kPixelMm, room_from_patient, 0.0), renderer, room_from_patient);
}

}  // namespace isoshift
