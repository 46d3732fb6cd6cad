#include "registration/objective.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <numeric>
#include <random>

#include "geometry/error.h"

namespace isoshift {
namespace {

constexpr std::size_t kMinPixels = 100;

// The pixels that can be compared: those in the field, for gradients only those with all four neighbors in it.
std::vector<std::uint32_t> comparable_pixels(const Image<std::uint8_t>& field, SimilarityKind similarity) {
  std::vector<std::uint32_t> pixels;
  const int rim = similarity == SimilarityKind::kGradientCorrelation ? 1 : 0;
  for (int row = rim; row < field.rows - rim; ++row)
    for (int column = rim; column < field.columns - rim; ++column)
      if (field.at(column, row) && field.at(column - rim, row) && field.at(column + rim, row) &&
          field.at(column, row - rim) && field.at(column, row + rim))
        pixels.push_back(static_cast<std::uint32_t>(field.index(column, row)));
  return pixels;
}

}  // namespace

Objective::Objective(Renderer& renderer, std::span<const FixedImage> images, const ObjectiveOptions& options)
    : renderer_(renderer), similarity_(options.similarity) {
  std::mt19937_64 random(options.seed);
  for (const FixedImage& image : images) {
    const std::vector<std::uint32_t> field = comparable_pixels(image.field, similarity_);
    if (field.size() < kMinPixels)
      throw Error(fmt::format("view {}: only {} of {} pixels lie in the irradiated field, too few to compare",
                              views_.size() + 1, field.size(), image.field.pixels.size()));
    const auto wanted = static_cast<std::size_t>(options.pixel_fraction * static_cast<double>(field.size()));
    std::vector<std::uint32_t> compared;
    std::ranges::sample(field, std::back_inserter(compared), static_cast<std::ptrdiff_t>(std::max(kMinPixels, wanted)),
                        random);
    add_view(image, compared);
  }
}

void Objective::add_view(const FixedImage& image, const std::vector<std::uint32_t>& compared) {
  const auto columns = static_cast<std::uint32_t>(image.field.columns);
  std::vector<std::uint32_t> rendered = compared;
  if (similarity_ == SimilarityKind::kGradientCorrelation) {
    for (const std::uint32_t pixel : compared)
      rendered.insert(rendered.end(), {pixel - 1, pixel + 1, pixel - columns, pixel + columns});
    std::ranges::sort(rendered);
    rendered.erase(std::unique(rendered.begin(), rendered.end()), rendered.end());
  }

  Target target;
  for (const std::uint32_t pixel : rendered) target.line_integral.push_back(image.line_integral.pixels[pixel]);
  if (similarity_ == SimilarityKind::kGradientCorrelation) {
    const auto place = [&](std::uint32_t pixel) {
      return static_cast<std::uint32_t>(std::ranges::lower_bound(rendered, pixel) - rendered.begin());
    };
    for (const std::uint32_t pixel : compared)
      target.neighbors.push_back({place(pixel - 1), place(pixel + 1), place(pixel - columns), place(pixel + columns)});
    target.gradients = gradients(target.line_integral, target.neighbors);
  }
  views_.push_back(image.view);
  pixels_.of_view.push_back(std::move(rendered));
  targets_.push_back(std::move(target));
}

double Objective::compare(const Target& target, std::span<const float> drr) const {
  if (similarity_ == SimilarityKind::kNcc) return normalized_cross_correlation(target.line_integral, drr);
  return gradient_correlation(target.gradients, gradients(drr, target.neighbors));
}

std::vector<std::vector<double>> Objective::per_view(std::span<const Eigen::Isometry3d> room_from_patient) {
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  const RenderResult drrs = renderer_.render(views_, room_from_patient, pixels_);
  const auto rendered = Clock::now();
  std::vector<std::vector<double>> similarity(room_from_patient.size());
  for (std::size_t pose = 0; pose < room_from_patient.size(); ++pose)
    for (std::size_t view = 0; view < views_.size(); ++view)
      similarity[pose].push_back(compare(targets_[view], drrs.line_integrals(pose, view)));
  seconds_.rendering += std::chrono::duration<double>(rendered - begin).count();
  seconds_.similarity += std::chrono::duration<double>(Clock::now() - rendered).count();
  return similarity;
}

std::vector<double> Objective::values(std::span<const Eigen::Isometry3d> room_from_patient) {
  std::vector<double> means;
  for (const std::vector<double>& views : per_view(room_from_patient))
    means.push_back(std::accumulate(views.begin(), views.end(), 0.0) / static_cast<double>(views.size()));
  return means;
}

}  // namespace isoshift
