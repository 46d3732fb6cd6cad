#include "registration/objective.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "geometry/error.h"
#include "registration/similarity/ncc.h"

namespace isoshift {
namespace {

constexpr std::size_t kMinPixels = 100;

}  // namespace

Objective::Objective(Renderer& renderer, std::span<const FixedImage> images, double pixel_fraction, std::uint64_t seed)
    : renderer_(renderer) {
  std::mt19937_64 random(seed);
  for (const FixedImage& image : images) {
    views_.push_back(image.view);
    std::vector<std::uint32_t> field;
    for (std::uint32_t pixel = 0; pixel < image.field.pixels.size(); ++pixel)
      if (image.field.pixels[pixel] != 0) field.push_back(pixel);
    if (field.size() < kMinPixels)
      throw Error(fmt::format("view {}: only {} of {} pixels lie in the irradiated field, too few to compare",
                              views_.size(), field.size(), image.field.pixels.size()));
    const auto count = std::max(kMinPixels, static_cast<std::size_t>(pixel_fraction * static_cast<double>(field.size())));
    std::vector<std::uint32_t> chosen;
    std::ranges::sample(field, std::back_inserter(chosen), static_cast<std::ptrdiff_t>(std::min(count, field.size())),
                        random);
    std::vector<float> values;
    for (const std::uint32_t pixel : chosen) values.push_back(image.line_integral.pixels[pixel]);
    pixels_.of_view.push_back(std::move(chosen));
    fixed_.push_back(std::move(values));
  }
}

std::vector<std::vector<double>> Objective::per_view(std::span<const Eigen::Isometry3d> room_from_patient) {
  const RenderResult drrs = renderer_.render(views_, room_from_patient, pixels_);
  std::vector<std::vector<double>> similarity(room_from_patient.size());
  for (std::size_t pose = 0; pose < room_from_patient.size(); ++pose)
    for (std::size_t view = 0; view < views_.size(); ++view)
      similarity[pose].push_back(normalized_cross_correlation(fixed_[view], drrs.line_integrals(pose, view)));
  return similarity;
}

std::vector<double> Objective::values(std::span<const Eigen::Isometry3d> room_from_patient) {
  std::vector<double> means;
  for (const std::vector<double>& views : per_view(room_from_patient))
    means.push_back(std::accumulate(views.begin(), views.end(), 0.0) / static_cast<double>(views.size()));
  return means;
}

}  // namespace isoshift
