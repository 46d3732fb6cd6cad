#include "registration/bodies/target_match.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "base/median.h"
#include "registration/pose_parameters.h"
#include "registration/similarity/tiles.h"

namespace isoshift {
namespace {

using Eigen::Vector3d;

constexpr double kPixelMm = 2.0, kCoarsePixelMm = 4.0, kTargetMm = 20.0, kPartMm = 12.0;
constexpr std::size_t kLeastPixelsOfAPart = 6;
constexpr int kLeastPixels = 100;  // near the target, with all neighbors: the circles have about 300
constexpr double kFarther = 1.2;
constexpr double kKept = 0.7;
constexpr int kMostSteps = 20;
constexpr double kSameScale = 1e-9;

// Pixels of a field whose neighbors lie in it, too: those with gradients.
int pixels_with_neighbors(const Image<std::uint8_t>& field) {
  int count = 0;
  for (int row = 1; row + 1 < field.rows; ++row)
    for (int column = 1; column + 1 < field.columns; ++column)
      count += field.at(column, row) & field.at(column - 1, row) & field.at(column + 1, row) &
               field.at(column, row - 1) & field.at(column, row + 1);
  return count;
}

// Of a view what lies near the target: within `reach_mm`, or as much farther as it takes to see enough. Nothing if that
// is not to be had.
std::optional<FixedImage> near_target(double reach_mm, const FixedImage& image, const Vector3d& target_room_mm) {
  FixedImage near = image;
  const auto center = image.view.project(target_room_mm);
  for (double reach_px = reach_mm * pixels_per_mm(image.view); center; reach_px *= kFarther) {
    bool is_all = true;
    for (int row = 0; row < image.field.rows; ++row)
      for (int column = 0; column < image.field.columns; ++column) {
        const bool is_near = (Eigen::Vector2d(column, row) - *center).norm() <= reach_px;
        is_all = is_all && is_near;
        near.field.at(column, row) = is_near ? image.field.at(column, row) : 0;
      }
    if (pixels_with_neighbors(near.field) >= kLeastPixels) return near;
    if (is_all) break;
  }
  return std::nullopt;
}

using PlaneGradients = Eigen::Matrix<double, Eigen::Dynamic, 2>;  // a row per pixel

// About their medians: a slope of scatter across the surroundings is no anatomy.
PlaneGradients centered(const Gradients& gradients) {
  PlaneGradients all(static_cast<Eigen::Index>(gradients.along_row.size()), 2);
  for (const auto& [column, values] : {std::pair(0, &gradients.along_row), std::pair(1, &gradients.along_column)})
    all.col(column) = Eigen::Map<const Eigen::VectorXf>(values->data(), all.rows()).cast<double>().array() -
                      static_cast<double>(median(*values));
  return all;
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

// Line integrals, by view, of the pixels that an objective renders.
using Rendering = std::function<std::vector<std::vector<float>>(Objective&)>;

// One number of a view: its DRR has these gradients.
using Measure = std::function<double(const Objective&, std::size_t view, const Gradients& drr)>;

double of_most(const Objective& pixels, std::size_t view, const Gradients& drr) {
  return trimmed_correlation(pixels.comparison(view).xray_gradients(), drr);
}
double of_all(const Objective& pixels, std::size_t view, const Gradients& drr) {
  return gradient_correlation(pixels.comparison(view).xray_gradients(), drr);
}
double of_parts(const Objective& pixels, std::size_t view, const Gradients& drr) {
  return match_of_parts(pixels.views()[view], pixels.compared_pixels(view), pixels.comparison(view).xray_gradients(),
                        drr);
}

// The mean of each measure over the views.
std::vector<double> means(const std::vector<FixedImage>& level, Renderer& renderer, const Eigen::Isometry3d& about,
                          const Rendering& rendering, const std::vector<Measure>& measures) {
  Objective pixels(renderer, level, about, {.similarity = SimilarityKind::kGradientCorrelation});
  const std::vector<std::vector<float>> drrs = rendering(pixels);
  std::vector<double> all(measures.size());
  for (std::size_t view = 0; view < drrs.size(); ++view) {
    const Gradients drr = gradients(drrs[view], pixels.comparison(view).neighbors());
    for (std::size_t n = 0; n < measures.size(); ++n)
      all[n] += measures[n](pixels, view, drr) / static_cast<double>(drrs.size());
  }
  return all;
}

Rendering of_whole(const Eigen::Isometry3d& room_from_patient) {
  return [&room_from_patient](Objective& pixels) {
    const RenderResult rendered = pixels.render(std::span(&room_from_patient, 1));
    std::vector<std::vector<float>> drrs;
    for (std::size_t view = 0; view < pixels.views().size(); ++view) {
      const auto drr = rendered.line_integrals(0, view);
      drrs.emplace_back(drr.begin(), drr.end());
    }
    return drrs;
  };
}

// The measures of what lies within some distance of the target, on pixels of some size; 0 where too little is shown.
struct Surroundings {
  const FixedViews& views;
  Renderer& renderer;
  const Eigen::Isometry3d& about;
  const Vector3d& target_room_mm;
  const Rendering& rendering;

  std::vector<double> measured(double pixel_mm, double reach_mm, const std::vector<Measure>& measures) const {
    std::vector<FixedImage> level = views.reduced_to(pixel_mm, about, 0.0);
    for (FixedImage& image : level) {
      std::optional<FixedImage> near = near_target(reach_mm, image, target_room_mm);
      if (!near) return std::vector<double>(measures.size(), 0.0);
      image = std::move(*near);
    }
    return means(level, renderer, about, rendering, measures);
  }
  CoarseMatch coarse_match() const {
    const std::vector<double> both = measured(kCoarsePixelMm, kAboutTargetMm, {of_all, of_parts});
    return {.of_all = both[0], .of_parts = both[1]};
  }
};

}  // namespace

// Least trimmed squares by concentration steps: Rousseeuw and Van Driessen, Data Min Knowl Discov 12 (2006) 29-45,
// section 2. Every step fits the scale to the pixels kept and then keeps those that fit it best.
double trimmed_correlation(const Gradients& xray, const Gradients& drr) {
  const PlaneGradients there = centered(xray), here = centered(drr);
  const Eigen::VectorXd products = there.cwiseProduct(here).rowwise().sum(),
                        there_squared = there.rowwise().squaredNorm(), here_squared = here.rowwise().squaredNorm();
  std::vector<Eigen::Index> order(xray.along_row.size());
  std::iota(order.begin(), order.end(), 0);
  const auto most = static_cast<std::size_t>(std::lround(kKept * static_cast<double>(order.size())));
  std::span<const Eigen::Index> kept = order;
  double scale = 0.0, correlation = 0.0;
  for (int step = 0; step < kMostSteps; ++step) {
    double product = 0.0, norm2_there = 0.0, norm2_here = 0.0;
    for (const Eigen::Index n : kept) {
      product += products[n];
      norm2_there += there_squared[n];
      norm2_here += here_squared[n];
    }
    if (!(norm2_there > 0.0 && norm2_here > 0.0)) return 0.0;
    correlation = product / std::sqrt(norm2_there * norm2_here);
    const double fitted = product / norm2_here;
    if (std::abs(fitted - scale) <= kSameScale * std::abs(fitted)) break;  // the same pixels would be kept
    scale = fitted;
    std::ranges::nth_element(order, order.begin() + static_cast<std::ptrdiff_t>(most), {}, [&](Eigen::Index n) {
      return there_squared[n] + scale * (scale * here_squared[n] - 2.0 * products[n]);
    });
    kept = std::span(order).first(most);
  }
  return correlation;
}

TargetMatch match_near_target(const BodyScene& scene, const Vector3d& target_room_mm, const BodyPoses& poses) {
  const Rendering rendering = [&](Objective& pixels) {
    std::vector<std::vector<float>> drrs;
    for (std::size_t view = 0; view < pixels.views().size(); ++view)
      drrs.push_back(scene.fine.line_integrals(pixels, poses, view));
    return drrs;
  };
  const Surroundings near{scene.views, *scene.fine.as_one, poses.front().front(), target_room_mm, rendering};
  const CoarseMatch coarse = near.coarse_match();
  return {.of_most_within_40_mm = near.measured(kPixelMm, kAboutTargetMm, {of_most}).front(),
          .of_most_within_20_mm = near.measured(kPixelMm, kTargetMm, {of_most}).front(),
          .of_all = coarse.of_all,
          .of_parts = coarse.of_parts};
}

CoarseMatch match_near_target(const FixedViews& views, Renderer& renderer, const Eigen::Isometry3d& room_from_patient,
                              const Vector3d& target_room_mm) {
  return Surroundings{views, renderer, room_from_patient, target_room_mm, of_whole(room_from_patient)}.coarse_match();
}

double match_of_parts_everywhere(const FixedViews& views, Renderer& renderer,
                                 const Eigen::Isometry3d& room_from_patient) {
  return means(views.reduced_to(kCoarsePixelMm, room_from_patient, 0.0), renderer, room_from_patient,
               of_whole(room_from_patient), {of_parts})
      .front();
}

std::optional<Vector3d> place_wanted_near_target(const RendererPyramid& renderers, const FixedViews& views,
                                                 const Eigen::Isometry3d& room_from_patient,
                                                 const Vector3d& target_room_mm, const SearchOptions& options) {
  FixedViews near{.images = {}, .region = views.region};
  for (const FixedImage& image : views.images) {
    std::optional<FixedImage> part = near_target(kAboutTargetMm, image, target_room_mm);
    if (!part) return std::nullopt;
    near.images.push_back(std::move(*part));
  }
  SearchOptions last_stage = options;
  last_stage.stages = {options.stages.back()};
  last_stage.parameters.clear();
  const auto found = search_if_possible(renderers, near, room_from_patient, last_stage);
  if (!found) return std::nullopt;
  return setup_error_from_parameters(found->parameters) * target_room_mm;
}

}  // namespace isoshift
