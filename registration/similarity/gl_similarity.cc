#include "registration/similarity/gl_similarity.h"

#include <epoxy/gl.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <stdexcept>
#include <string>

#include "registration/similarity/similarity.comp.h"

namespace isoshift {
namespace {

// Binding slots and uniform locations, as in similarity.comp.
constexpr std::uint32_t kLineIntegrals = 0, kViews = 1, kXray = 2, kPairs = 3, kResult = 4;
enum Uniform : int { kFirstPose = 0, kViewCount = 1, kPixelsPerPose = 2 };

static_assert(kRankBins == 256 && kInformationBins == 32 && kSharesPerPixel == 256,
              "similarity.comp has these numbers");

constexpr std::size_t kMaxGroups = 65535;  // what every OpenGL 4.5 allows along each axis

struct GlView {
  std::uint32_t first_pixel, first_compared, compared;
  float low, per_unit;
};

ShaderSource shader(SimilarityKind kind) {
  const char* variant = "";
  switch (kind) {
    case SimilarityKind::kNcc: variant = "NCC"; break;
    case SimilarityKind::kGradientCorrelation: variant = "GRADIENT_CORRELATION"; break;
    case SimilarityKind::kStochasticRankCorrelation: variant = "RANK_CORRELATION"; break;
    case SimilarityKind::kMutualInformation: variant = "MUTUAL_INFORMATION"; break;
    case SimilarityKind::kNormalizedMutualInformation: variant = "NORMALIZED_MUTUAL_INFORMATION"; break;
  }
  return {"#define " + std::string(variant) + "\n#line 1\n" + kSimilarityComp,
          "registration/similarity/similarity.comp"};
}

// Adds a list less its mean and divided by its norm, or zeros: what is left of Pearson's correlation is one product.
void add_standardized(std::span<const float> values, std::vector<float>& to) {
  const double mean =
      std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(std::max<std::size_t>(1, values.size()));
  double squares = 0.0;
  for (const float value : values) squares += (value - mean) * (value - mean);
  const double scale = squares > 0.0 ? 1.0 / std::sqrt(squares) : 0.0;
  for (const float value : values) to.push_back(static_cast<float>(scale * (value - mean)));
}

// What the DRRs of all views are compared with, one after the other.
struct XraySide {
  std::vector<float> values;         // standardized, of gradients first those along rows
  std::vector<std::uint32_t> bins;   // of mutual information
  std::vector<std::uint32_t> pairs;  // of gradients: the pixels before and behind

  std::size_t size() const { return values.size() + bins.size(); }

  void add(const Comparison& comparison) {
    bins.insert(bins.end(), comparison.bins().begin(), comparison.bins().end());
    if (comparison.kind() != SimilarityKind::kGradientCorrelation) {
      add_standardized(comparison.values(), values);
      return;
    }
    add_standardized(comparison.xray_gradients().along_row, values);
    add_standardized(comparison.xray_gradients().along_column, values);
    for (const Neighbors& at : comparison.neighbors()) pairs.insert(pairs.end(), {at.left, at.right});
    for (const Neighbors& at : comparison.neighbors()) pairs.insert(pairs.end(), {at.above, at.below});
  }
};

// Buffers are never of no size: one number stands in where there is nothing.
template <class T>
void upload(std::vector<T> values, Buffer& to) {
  if (values.empty()) values.emplace_back();
  to.upload(std::as_bytes(std::span(values)));
}

SimilarityKind common_kind(std::span<const Comparison> comparisons) {
  if (comparisons.empty()) throw std::invalid_argument("nothing to compare");
  for (const Comparison& comparison : comparisons)
    if (comparison.kind() != comparisons.front().kind()) throw std::invalid_argument("similarities of several kinds");
  return comparisons.front().kind();
}

}  // namespace

GlSimilarity::GlSimilarity(GlContext& context, std::span<const Comparison> comparisons)
    : context_(context), program_(context.program(shader(common_kind(comparisons)))), view_count_(comparisons.size()) {
  std::vector<GlView> views;
  XraySide xray;
  for (const Comparison& comparison : comparisons) {
    views.push_back({.first_pixel = static_cast<std::uint32_t>(pixels_per_pose_),
                     .first_compared = static_cast<std::uint32_t>(xray.size()),
                     .compared = static_cast<std::uint32_t>(comparison.pixels_compared()),
                     .low = comparison.drr_range().low,
                     .per_unit = comparison.drr_range().per_unit});
    xray.add(comparison);
    pixels_per_pose_ += comparison.pixels();
  }
  upload(views, views_);
  if (xray.bins.empty())
    upload(xray.values, xray_);
  else
    upload(xray.bins, xray_);
  upload(xray.pairs, pairs_);
  context_.check("uploading the X-rays");
}

std::vector<std::vector<double>> GlSimilarity::of(const Buffer& line_integrals, std::size_t poses) {
  if (poses == 0) return {};
  context_.make_current();
  std::vector<float> similarities(poses * view_count_);
  result_.reserve(similarities.size() * sizeof(float));
  program_.use();
  line_integrals.bind(kLineIntegrals);
  views_.bind(kViews);
  xray_.bind(kXray);
  pairs_.bind(kPairs);
  result_.bind(kResult);
  glUniform1ui(kViewCount, static_cast<GLuint>(view_count_));
  glUniform1ui(kPixelsPerPose, static_cast<GLuint>(pixels_per_pose_));
  for (std::size_t first = 0; first < poses; first += kMaxGroups) {
    glUniform1ui(kFirstPose, static_cast<GLuint>(first));
    glDispatchCompute(static_cast<GLuint>(std::min(kMaxGroups, poses - first)), static_cast<GLuint>(view_count_), 1);
  }
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  result_.download(std::as_writable_bytes(std::span(similarities)));
  context_.check("comparing");

  std::vector<std::vector<double>> of_pose;
  for (auto first = similarities.begin(); first != similarities.end();
       first += static_cast<std::ptrdiff_t>(view_count_))
    of_pose.emplace_back(first, first + static_cast<std::ptrdiff_t>(view_count_));
  return of_pose;
}

}  // namespace isoshift
