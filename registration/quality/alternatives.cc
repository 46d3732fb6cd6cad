#include "registration/quality/alternatives.h"

#include <fmt/format.h>

#include <algorithm>

#include "geometry/rotation.h"

namespace isoshift {
namespace {

// Wide enough to find a pose of its own for every alternative, and ending on what tells structures apart.
std::vector<Stage> short_stages() {
  return {{.name = "coarse",
           .similarity = SimilarityKind::kStochasticRankCorrelation,
           .pixel_mm = 5.0,
           .voxel_mm = 4.0,
           .initial_step_mm = 8.0,
           .initial_step_rad = rad_from_deg(3.5),
           .relative_tolerance = 0.05,
           .max_evaluations = 80},
          {.name = "medium",
           .similarity = SimilarityKind::kGradientCorrelation,
           .pixel_mm = 4.0,
           .voxel_mm = 3.0,
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

}  // namespace

AlternativesReport compare_alternatives(const RendererPyramid& renderers, std::span<const FixedImage> images,
                                        const Eigen::Isometry3d& start_room_from_patient,
                                        const SearchOptions& options) {
  const std::vector<Stage> stages = short_stages();
  SearchOptions short_search = options;
  short_search.stages = stages;
  // Small images suffice, and are quicker to reduce again.
  std::vector<FixedImage> small;
  for (const FixedImage& image : images) small.push_back(at_pixel_size(image, 1.0));
  const auto reached = [&](const std::vector<FixedImage>& as) {
    return search(renderers, as, start_room_from_patient, short_search).stages.back().value;
  };

  AlternativesReport report{.similarity = reached(small)};
  const auto try_as = [&](std::string description, const std::vector<FixedImage>& as) {
    report.alternatives.push_back({.description = std::move(description), .similarity = reached(as)});
  };
  for (std::size_t view = 0; view < small.size(); ++view) {
    std::vector<FixedImage> as = small;
    as[view] = mirrored(small[view]);
    try_as(fmt::format("view {} mirrored", view + 1), as);
    as[view] = turned(small[view]);
    try_as(fmt::format("view {} turned by 180 degrees", view + 1), as);
  }
  for (std::size_t view = 1; view < small.size(); ++view) {
    std::vector<FixedImage> as = small;
    std::swap(as[0].view, as[view].view);
    // Images of different sizes cannot have been exchanged.
    if (as[0].view.columns != small[0].view.columns || as[0].view.rows != small[0].view.rows) continue;
    try_as(fmt::format("views 1 and {} exchanged", view + 1), as);
  }
  return report;
}

}  // namespace isoshift
