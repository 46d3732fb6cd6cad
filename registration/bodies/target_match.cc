#include "registration/bodies/target_match.h"

#include <algorithm>
#include <map>
#include <vector>

namespace isoshift {
namespace {

using Eigen::Vector3d;

constexpr double kPixelMm = 4.0, kReachMm = 40.0, kPartMm = 12.0;
constexpr std::ptrdiff_t kLeastPixels = 200;
constexpr std::size_t kLeastPixelsOfAPart = 6;

std::vector<FixedImage> surroundings(const BodyScene& scene, const Vector3d& target_room_mm) {
  std::vector<FixedImage> level = scene.views.reduced_to(kPixelMm, scene.whole_room_from_patient, 0.0);
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

// Numbers of compared pixels, part by part.
std::vector<std::vector<std::size_t>> parts_of(const XrayView& view, std::span<const std::uint32_t> compared) {
  const int edge = std::max(1, static_cast<int>(std::lround(kPartMm * pixels_per_mm(view))));
  std::map<std::pair<int, int>, std::vector<std::size_t>> by_place;
  for (std::size_t n = 0; n < compared.size(); ++n)
    by_place[{static_cast<int>(compared[n]) / view.columns / edge, static_cast<int>(compared[n]) % view.columns / edge}]
        .push_back(n);
  std::vector<std::vector<std::size_t>> parts;
  for (auto& [place, pixels] : by_place)
    if (pixels.size() >= kLeastPixelsOfAPart) parts.push_back(std::move(pixels));
  return parts;
}

// Centered.
Eigen::VectorXd values_of(const std::vector<float>& all, const std::vector<std::size_t>& numbers) {
  Eigen::VectorXd values(static_cast<Eigen::Index>(numbers.size()));
  for (std::size_t n = 0; n < numbers.size(); ++n) values[static_cast<Eigen::Index>(n)] = all[numbers[n]];
  return values.array() - values.mean();
}

}  // namespace

TargetMatch match_near_target(const BodyScene& scene, const Vector3d& target_room_mm, const BodyPoses& poses) {
  const std::vector<FixedImage> level = surroundings(scene, target_room_mm);
  const Objective pixels(*scene.fine.as_one, level, poses.front().front(),
                         {.similarity = SimilarityKind::kGradientCorrelation});
  TargetMatch match;
  double sum = 0.0, weights = 0.0;
  for (std::size_t view = 0; view < level.size(); ++view) {
    const Comparison& comparison = pixels.comparison(view);
    const std::vector<float> drr = scene.fine.line_integrals(pixels, poses, view);
    match.of_all += comparison.of(drr) / static_cast<double>(level.size());
    const Gradients found = gradients(drr, comparison.neighbors());
    for (const std::vector<std::size_t>& part : parts_of(pixels.views()[view], pixels.compared_pixels(view)))
      for (const auto direction : {&Gradients::along_row, &Gradients::along_column}) {
        const Eigen::VectorXd xray = values_of(comparison.xray_gradients().*direction, part);
        const Eigen::VectorXd here = values_of(found.*direction, part);
        const double weight = here.norm();
        if (xray.norm() > 0.0) sum += xray.dot(here) / xray.norm();  // correlation times weight
        weights += weight;
      }
  }
  match.of_parts = weights > 0.0 ? sum / weights : 0.0;
  return match;
}

}  // namespace isoshift
