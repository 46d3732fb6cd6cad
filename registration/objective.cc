#include "registration/objective.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <numeric>
#include <optional>
#include <random>

#include "base/error.h"
#include "base/parallel.h"
#include "drr/images_on_gpu.h"
#include "registration/similarity/gl_similarity.h"

namespace isoshift {
namespace {

constexpr std::size_t kMinPixels = 100;

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

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

std::size_t wanted_pixels(std::size_t available, const ObjectiveOptions& options) {
  const auto share = static_cast<std::size_t>(options.pixel_fraction * static_cast<double>(available));
  return std::min(available, std::max({kMinPixels, options.min_pixels, share}));
}

std::vector<std::uint32_t> drawn_pixels(const std::vector<std::uint32_t>& pixels, const ObjectiveOptions& options,
                                        std::mt19937_64& random) {
  std::vector<std::uint32_t> drawn;
  std::ranges::sample(pixels, std::back_inserter(drawn),
                      static_cast<std::ptrdiff_t>(wanted_pixels(pixels.size(), options)), random);
  return drawn;
}

// Gradients need their neighbors rendered, too: pixels are taken in square patches, which share them, and those with
// the strongest gradients of the DRR first. Where it has none, there is only noise to compare. A DRR with pixels
// `coarser` times as large tells that as well.
std::vector<std::uint32_t> strongest_pixels(const std::vector<std::uint32_t>& pixels, int columns,
                                            const Image<float>& drr, int coarser, const ObjectiveOptions& options) {
  struct Patch {
    double strength = 0.0;
    std::vector<std::uint32_t> pixels;
  };
  constexpr std::size_t kPatchEdge = 8;
  const std::size_t patches_per_row = static_cast<std::size_t>(columns) / kPatchEdge + 1;
  std::vector<Patch> patches(pixels.empty() ? 0 : patches_per_row * (pixels.back() / columns / kPatchEdge + 1));
  for (const std::uint32_t pixel : pixels) {
    const int column = static_cast<int>(pixel) % columns, row = static_cast<int>(pixel) / columns;
    Patch& patch = patches[static_cast<std::size_t>(row) / kPatchEdge * patches_per_row +
                           static_cast<std::size_t>(column) / kPatchEdge];
    const int c = std::clamp(column / coarser, 1, drr.columns - 2), r = std::clamp(row / coarser, 1, drr.rows - 2);
    const float along_row = drr.at(c + 1, r) - drr.at(c - 1, r);
    const float along_column = drr.at(c, r + 1) - drr.at(c, r - 1);
    patch.strength += along_row * along_row + along_column * along_column;
    patch.pixels.push_back(pixel);
  }
  std::ranges::stable_sort(patches, std::greater(), &Patch::strength);
  const std::size_t wanted = wanted_pixels(pixels.size(), options);
  std::vector<std::uint32_t> strongest;
  for (const Patch& patch : patches) {
    if (strongest.size() >= wanted) break;
    strongest.insert(strongest.end(), patch.pixels.begin(), patch.pixels.end());
  }
  std::ranges::sort(strongest);
  return strongest;
}

// The pixels and those beside, above and below them, in rising order.
std::vector<std::uint32_t> with_neighbors(const std::vector<std::uint32_t>& pixels, const Image<std::uint8_t>& field) {
  std::vector<std::uint8_t> is_wanted(field.pixels.size());
  const auto columns = static_cast<std::uint32_t>(field.columns);
  for (const std::uint32_t pixel : pixels)
    for (const std::uint32_t wanted : {pixel, pixel - 1, pixel + 1, pixel - columns, pixel + columns})
      is_wanted[wanted] = 1;
  std::vector<std::uint32_t> all;
  for (std::size_t pixel = 0; pixel < is_wanted.size(); ++pixel)
    if (is_wanted[pixel] != 0) all.push_back(static_cast<std::uint32_t>(pixel));
  return all;
}

// Where the neighbors of the pixels compared stand among those rendered.
std::vector<Neighbors> neighbors_among(const std::vector<std::uint32_t>& rendered,
                                       const std::vector<std::uint32_t>& compared, const Image<std::uint8_t>& field) {
  std::vector<std::uint32_t> place(field.pixels.size());
  for (std::size_t n = 0; n < rendered.size(); ++n) place[rendered[n]] = static_cast<std::uint32_t>(n);
  const auto columns = static_cast<std::uint32_t>(field.columns);
  std::vector<Neighbors> neighbors;
  neighbors.reserve(compared.size());
  for (const std::uint32_t pixel : compared)
    neighbors.push_back({place[pixel - 1], place[pixel + 1], place[pixel - columns], place[pixel + columns]});
  return neighbors;
}

// DRRs with pixels twice as large as the images', where these have enough.
class CoarseDrrs {
 public:
  CoarseDrrs(Renderer& renderer, std::span<const FixedImage> images, const Eigen::Isometry3d& room_from_patient) {
    constexpr int kFewest = 8;
    for (const FixedImage& image : images) {
      coarser_.push_back(std::min(image.view.columns, image.view.rows) < kFewest ? 1 : 2);
      views_.push_back(image.view.downscaled(coarser_.back()));
    }
    drrs_ = renderer.render(views_, std::span(&room_from_patient, 1), PixelSet::all());
  }
  int coarser(std::size_t view) const { return coarser_[view]; }
  Image<float> image(std::size_t view) const { return image_of(views_[view], drrs_.line_integrals(0, view)); }

 private:
  std::vector<int> coarser_;
  std::vector<XrayView> views_;
  RenderResult drrs_{{}, {}};
};

void for_each_view(std::span<const FixedImage> images, const auto& work) {
  parallel_for(std::size_t{0}, images.size(), work);
}

}  // namespace

Objective::Objective(Renderer& renderer, std::span<const FixedImage> images, const Eigen::Isometry3d& about,
                     const ObjectiveOptions& options)
    : renderer_(renderer), similarity_(options.similarity) {
  if (images.empty()) throw UsageError("images: expected at least one");
  if (!(options.pixel_fraction > 0.0 && options.pixel_fraction <= 1.0))
    throw UsageError(fmt::format("pixel_fraction is {}, expected more than 0, at most 1", options.pixel_fraction));
  const bool of_gradients = similarity_ == SimilarityKind::kGradientCorrelation;
  compared_.resize(images.size());
  for_each_view(images,
                [&](std::size_t view) { compared_[view] = comparable_pixels(images[view].field, similarity_); });
  for (std::size_t view = 0; view < images.size(); ++view)
    if (compared_[view].size() < kMinPixels)
      throw Error(fmt::format(
          "{}: only {} of {} pixels lie in the irradiated field and are neither saturated nor excluded, too "
          "few to compare",
          name_of_view(images[view].label, view), compared_[view].size(), images[view].field.pixels.size()));
  if (of_gradients) {
    const CoarseDrrs drrs(renderer, images, about);
    for_each_view(images, [&](std::size_t view) {
      compared_[view] =
          strongest_pixels(compared_[view], images[view].view.columns, drrs.image(view), drrs.coarser(view), options);
    });
  } else {
    std::mt19937_64 random(options.seed);
    for (std::vector<std::uint32_t>& of_view : compared_) of_view = drawn_pixels(of_view, options, random);
  }

  pixels_.of_view.resize(images.size());
  for (const FixedImage& image : images) views_.push_back(image.view);
  for_each_view(images, [&](std::size_t view) {
    pixels_.of_view[view] = of_gradients ? with_neighbors(compared_[view], images[view].field) : compared_[view];
  });
  std::vector<Range> drr_ranges(images.size());
  if (has_histogram(similarity_)) {
    const RenderResult drrs = render(std::span(&about, 1));
    for (std::size_t view = 0; view < images.size(); ++view)
      drr_ranges[view] = wide_range_of(drrs.line_integrals(0, view));
  }
  std::vector<std::optional<Comparison>> comparisons(images.size());
  for_each_view(images, [&](std::size_t view) {
    const FixedImage& image = images[view];
    std::vector<Neighbors> neighbors;
    if (of_gradients) neighbors = neighbors_among(pixels_.of_view[view], compared_[view], image.field);
    std::vector<float> xray;
    xray.reserve(pixels_.of_view[view].size());
    for (const std::uint32_t pixel : pixels_.of_view[view]) xray.push_back(image.line_integral.pixels[pixel]);
    comparisons[view].emplace(similarity_, std::move(xray), std::move(neighbors), drr_ranges[view]);
  });
  for (std::optional<Comparison>& comparison : comparisons) comparisons_.push_back(*std::move(comparison));
  if (ImagesOnGpu* gl = renderer_.on_gpu(); gl != nullptr && !comparisons_.empty())
    gl_similarity_ = std::make_unique<GlSimilarity>(gl->context(), comparisons_);
}

Objective::~Objective() = default;

template <class Render, class Compare>
auto Objective::on_gpu(std::span<const Eigen::Isometry3d> room_from_patient, bool with_derivatives, Render render,
                       Compare compare) {
  ImagesOnGpu& gl = *renderer_.on_gpu();
  std::size_t pixels_per_pose = 0;
  for (const auto& of_view : pixels_.of_view) pixels_per_pose += of_view.size();
  constexpr std::size_t kMostPoses = 1024;  // what is made of the images needs memory, too
  const std::size_t at_once = std::min(kMostPoses, gl.poses_at_once(pixels_per_pose, with_derivatives));
  decltype(compare(render(gl, room_from_patient), std::size_t{0})) all;
  for (std::size_t first = 0; first < room_from_patient.size(); first += at_once) {
    const auto poses = room_from_patient.subspan(first, std::min(at_once, room_from_patient.size() - first));
    const auto begin = Clock::now();
    const auto& drrs = render(gl, poses);
    double rendering = seconds_since(begin);  // on llvmpipe all of it, on a GPU until it is under way
    const auto part = compare(drrs, poses.size());
    all.insert(all.end(), part.begin(), part.end());
    // By now its clock can be read without waiting; glFinish() in between would keep the GPU idle.
    const double both = seconds_since(begin);
    rendering = std::min(both, rendering + renderer_.gpu_seconds().value_or(0.0));
    seconds_.rendering += rendering;
    seconds_.similarity += both - rendering;
  }
  return all;
}

std::vector<std::vector<double>> Objective::per_view(std::span<const Eigen::Isometry3d> room_from_patient) {
  if (gl_similarity_)
    return on_gpu(
        room_from_patient, false,
        [&](ImagesOnGpu& gl, auto poses) -> const Buffer& { return gl.render_on_gpu(views_, poses, pixels_); },
        [&](const Buffer& line_integrals, std::size_t poses) { return gl_similarity_->of(line_integrals, poses); });
  const auto begin = Clock::now();
  const RenderResult drrs = render(room_from_patient);
  const double rendering = seconds_since(begin);
  std::vector<std::vector<double>> similarity(room_from_patient.size());
  for (std::size_t pose = 0; pose < room_from_patient.size(); ++pose)
    for (std::size_t view = 0; view < views_.size(); ++view)
      similarity[pose].push_back(comparisons_[view].of(drrs.line_integrals(pose, view)));
  seconds_.rendering += rendering;
  seconds_.similarity += seconds_since(begin) - rendering;
  return similarity;
}

std::vector<QuadraticModel> Objective::models_of_views(std::span<const Eigen::Isometry3d> room_from_patient) {
  if (gl_similarity_ && has_curvature(similarity_))
    return on_gpu(
        room_from_patient, true,
        [&](ImagesOnGpu& gl, auto poses) { return gl.render_with_derivatives_on_gpu(views_, poses, pixels_); },
        [&](const ImagesOnGpu::WithDerivatives& drrs, std::size_t poses) {
          return gl_similarity_->models(drrs.line_integrals, drrs.derivatives, poses);
        });
  const auto begin = Clock::now();
  const RenderResult drrs = render_with_derivatives(room_from_patient);
  const double rendering = seconds_since(begin);
  const std::size_t views = views_.size();
  std::vector<QuadraticModel> models(room_from_patient.size() * views);
  parallel_for(std::size_t{0}, models.size(), [&](std::size_t n) {
    const std::size_t pose = n / views, view = n % views;
    models[n] = comparisons_[view].model(drrs.line_integrals(pose, view), pixel_jacobian(drrs.derivatives(pose, view)));
  });
  seconds_.rendering += rendering;
  seconds_.similarity += seconds_since(begin) - rendering;
  return models;
}

std::vector<QuadraticModel> Objective::models(std::span<const Eigen::Isometry3d> room_from_patient) {
  const std::vector<QuadraticModel> of_views = models_of_views(room_from_patient);
  std::vector<QuadraticModel> means;
  const std::size_t views = views_.size();
  const double share = 1.0 / static_cast<double>(views);
  for (std::size_t first = 0; first < of_views.size(); first += views) {
    means.push_back(weighted_sum(share, of_views[first], 0.0, of_views[first]));
    for (std::size_t view = 1; view < views; ++view)
      means.back() = weighted_sum(1.0, means.back(), share, of_views[first + view]);
  }
  return means;
}

std::vector<double> Objective::values(std::span<const Eigen::Isometry3d> room_from_patient) {
  std::vector<double> means;
  for (const std::vector<double>& views : per_view(room_from_patient))
    means.push_back(std::accumulate(views.begin(), views.end(), 0.0) / static_cast<double>(views.size()));
  return means;
}

}  // namespace isoshift
