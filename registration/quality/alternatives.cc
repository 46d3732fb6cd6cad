#include "registration/quality/alternatives.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "geometry/rotation.h"
#include "registration/pose_parameters.h"

namespace isoshift {
namespace {

// Wide enough to find a pose of its own for every alternative, and ending on what tells structures apart.
std::vector<Stage> short_stages() {
  return {{.name = "coarse",
           .similarity = SimilarityKind::kStochasticRankCorrelation,
           .pixel_mm = 5.0,
           .voxel_mm = 4.0,
           .pixel_fraction = 0.35,
           .initial_step_mm = 8.0,
           .initial_step_rad = rad_from_deg(3.5),
           .relative_tolerance = 0.05,
           .max_evaluations = 80},
          {.name = "medium",
           .similarity = SimilarityKind::kGradientCorrelation,
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

// A search for the images as something.
struct Attempt {
  std::string description;
  FixedViews views;
  SearchResult found;
};

// What a search does not explain. Where an alternative and the images as they are differ by less than this factor, they
// are looked at closely: blurred, a head is symmetric.
double unexplained(const SearchResult& found) { return 1.0 - found.stages.back().value; }
constexpr double kClose = 1.5;

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

}  // namespace

std::vector<Alternative> compare_alternatives(const RendererPyramid& renderers, const FixedViews& views,
                                              const Eigen::Isometry3d& start_room_from_patient,
                                              const SearchOptions& options) {
  const std::vector<Stage> short_list = short_stages();
  SearchOptions short_search = options;
  short_search.stages = short_list;
  // The last stage to the end, and before it one from where the short ones leave off.
  std::vector<Stage> long_list = {short_list.back(), options.stages.back()};
  long_list.front().pixel_mm = 2.0 * options.stages.back().pixel_mm;
  long_list.front().voxel_mm = 2.0 * options.stages.back().voxel_mm;

  std::vector<Attempt> attempts = attempts_with(views);
  for (Attempt& attempt : attempts)
    attempt.found = search(renderers, attempt.views, start_room_from_patient, short_search);
  const auto is_close = [&](const Attempt& attempt) {
    const double ratio = unexplained(attempt.found) / unexplained(attempts.front().found);
    return ratio < kClose && ratio > 1.0 / kClose;
  };
  const auto closely = [&](const Attempt& attempt) {
    SearchOptions long_search = options;
    long_search.stages = long_list;
    long_search.parameters = attempt.found.parameters;
    return search(renderers, attempt.views, start_room_from_patient, long_search);
  };
  std::optional<SearchResult> as_is_closely;
  std::vector<Alternative> alternatives;
  for (std::size_t n = 1; n < attempts.size(); ++n) {
    SearchResult as_is = attempts.front().found, as_other = attempts[n].found;
    if (is_close(attempts[n])) {
      if (!as_is_closely) as_is_closely = closely(attempts.front());
      as_is = *as_is_closely;
      as_other = closely(attempts[n]);
    }
    const PoseDistance distance = distance_between(as_is.parameters, as_other.parameters);
    alternatives.push_back({.description = attempts[n].description,
                            .similarity = as_other.stages.back().value,
                            .as_is = as_is.stages.back().value,
                            .distance_mm = distance.translation_mm,
                            .angle_rad = distance.angle_rad});
  }
  return alternatives;
}

}  // namespace isoshift
