#include "registration/quality/alternatives.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "base/parallel.h"
#include "geometry/rotation.h"
#include "registration/pose_parameters.h"

namespace isoshift {
namespace {

// Wide enough to find a pose of its own for every alternative, and ending on
// what tells structures apart.
std::vector<Stage> short_stages() {
  return {{.name = "coarse",
           .similarity = SimilarityKind::kStochasticRankCorrelation,
           .optimizer = OptimizerKind::kLevenbergMarquardt,
           .pixel_mm = 5.0,
           .voxel_mm = 4.0,
           .pixel_fraction = 0.35,
           .initial_step_mm = 8.0,
           .initial_step_rad = rad_from_deg(3.5),
           .relative_tolerance = 0.05,
           .max_evaluations = 80},
          {.name = "medium",
           .similarity = SimilarityKind::kGradientCorrelation,
           .optimizer = OptimizerKind::kLevenbergMarquardt,
           .pixel_mm = 4.0,
           .voxel_mm = 3.0,
           .pixel_fraction = 0.4,
           .initial_step_mm = 1.5,
           .initial_step_rad = rad_from_deg(0.9),
           .relative_tolerance = 0.05,
           .max_evaluations = 60}};
}

template <class T>
void reverse_rows_of(Image<T>& image) {
  for (int row = 0; row < image.rows; ++row) {
    const auto begin = image.pixels.begin() + static_cast<std::ptrdiff_t>(row) * image.columns;
    std::reverse(begin, begin + image.columns);
  }
}

FixedImage mirrored(FixedImage image) {
  reverse_rows_of(image.line_integral);
  reverse_rows_of(image.field);
  return image;
}

FixedImage turned(FixedImage image) {
  std::ranges::reverse(image.line_integral.pixels);
  std::ranges::reverse(image.field.pixels);
  return image;
}

// Searches for the images as something, each level closer than the one before.
struct Attempt {
  std::string description;
  FixedViews views;
  std::vector<SearchResult> found = {};
};

// Blurred, a head is symmetric, and a short search may fail: an alternative that leaves less than this many times as
// much unexplained as the images as they are is searched for more closely. After each level but the last:
constexpr std::array kClose = {1.5, 1.25};

double unexplained(const SearchResult& found) { return 1.0 - found.stages.back().value; }

bool is_close(const Attempt& attempt, const Attempt& as_is, std::size_t level) {
  if (attempt.found.size() <= level) return false;
  return unexplained(attempt.found[level]) < kClose[level] * unexplained(as_is.found[level]);
}

std::vector<Attempt> attempts_with(const FixedViews& views) {
  std::vector<Attempt> attempts = {{.description = "as they are", .views = views}};
  const auto with = [&](std::string description, std::size_t view, FixedImage image) {
    attempts.push_back({.description = std::move(description), .views = views});
    attempts.back().views.images[view] = std::move(image);
  };
  const auto name = [&](std::size_t view) { return name_of_view(views.images[view].label, view); };
  for (std::size_t view = 0; view < views.images.size(); ++view) {
    with(fmt::format("{} mirrored", name(view)), view, mirrored(views.images[view]));
    with(fmt::format("{} turned by 180 degrees", name(view)), view, turned(views.images[view]));
  }
  for (std::size_t view = 1; view < views.images.size(); ++view) {
    const XrayView& first = views.images[0].view;
    const XrayView& other = views.images[view].view;
    if (first.columns != other.columns || first.rows != other.rows) continue;  // not exchanged unseen
    attempts.push_back({.description = fmt::format("{} and {} exchanged", name(0), name(view)), .views = views});
    std::swap(attempts.back().views.images[0].view, attempts.back().views.images[view].view);
  }
  return attempts;
}

// At once, where the renderers can.
template <class Items, class Work>
void for_each_on(const RendererPyramid& renderers, const Items& items, Work&& work) {
  if (uses_gl(renderers.finest().kind()))
    std::ranges::for_each(items, work);
  else
    parallel_for(std::size_t{0}, items.size(), [&](std::size_t n) { work(items[n]); });
}

}  // namespace

std::vector<Alternative> compare_alternatives(const RendererPyramid& renderers, const FixedViews& views,
                                              const Eigen::Isometry3d& start_room_from_patient,
                                              const SearchOptions& options, const SearchResult& found) {
  Stage closer = short_stages().back();
  closer.pixel_mm = 2.0 * options.stages.back().pixel_mm;
  closer.voxel_mm = 2.0 * options.stages.back().voxel_mm;
  const std::array<std::vector<Stage>, kClose.size() + 1> levels = {short_stages(), std::vector{closer},
                                                                    std::vector{options.stages.back()}};

  // Where the images as they are hardly match, the verdict does not depend on a closer look.
  constexpr double kHardlyMatches = 0.5;
  const std::size_t levels_searched = found.stages.back().value < kHardlyMatches ? 1 : levels.size();

  std::vector<Attempt> attempts = attempts_with(views);
  const Attempt& as_is = attempts.front();
  std::vector<Attempt*> searched;
  searched.reserve(attempts.size());
  for (Attempt& attempt : attempts) searched.push_back(&attempt);
  for (std::size_t level = 0; level < levels_searched && !searched.empty(); ++level) {
    SearchOptions of_level = options;
    of_level.stages = levels[level];
    for_each_on(renderers, searched, [&](Attempt* attempt) {
      SearchOptions from_there = of_level;
      if (level > 0)
        from_there.parameters = level == 1 && attempt == &as_is ? found.parameters : attempt->found.back().parameters;
      // Mirrored or turned, the field may miss the region: that is no alternative.
      if (attempt == &as_is)
        attempt->found.push_back(search(renderers, attempt->views, start_room_from_patient, from_there));
      else if (auto there = search_if_possible(renderers, attempt->views, start_room_from_patient, from_there))
        attempt->found.push_back(std::move(*there));
    });
    searched.clear();
    for (Attempt& attempt : attempts)
      if (&attempt != &as_is && level < kClose.size() && is_close(attempt, as_is, level)) searched.push_back(&attempt);
    if (!searched.empty()) searched.push_back(&attempts.front());
  }

  std::vector<Alternative> alternatives;
  for (const Attempt& attempt : std::span(attempts).subspan(1)) {
    if (attempt.found.empty()) continue;
    const SearchResult& as_other = attempt.found.back();
    const SearchResult& as_they_are = as_is.found[attempt.found.size() - 1];
    const PoseDistance distance = distance_between(as_they_are.parameters, as_other.parameters);
    alternatives.push_back({.description = attempt.description,
                            .similarity = as_other.stages.back().value,
                            .as_is = as_they_are.stages.back().value,
                            .distance_mm = distance.translation_mm,
                            .angle_rad = distance.angle_rad});
  }
  return alternatives;
}

}  // namespace isoshift
