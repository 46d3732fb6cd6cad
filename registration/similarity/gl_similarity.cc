#include "registration/similarity/gl_similarity.h"

#include <epoxy/gl.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <stdexcept>

#include "registration/similarity/comparison.glsl.h"
#include "registration/similarity/correlation_model.h"
#include "registration/similarity/correlation_sums.comp.h"
#include "registration/similarity/similarity.comp.h"

namespace isoshift {
namespace {

// Binding slots and uniform locations, as in comparison.glsl, similarity.comp and correlation_sums.comp.
constexpr std::uint32_t kLineIntegrals = 0, kViews = 1, kXray = 2, kPairs = 3, kResult = 4, kDerivatives = 5,
                        kTiles = 6, kMiddles = 7;
enum Uniform : int { kFirstPose = 0, kViewCount = 1, kPixelsPerPose = 2, kTileCount = 3 };

static_assert(kRankBins == 256 && kInformationBins == 32 && kSharesPerPixel == 256,
              "comparison.glsl and similarity.comp have these numbers");

constexpr std::size_t kTilePixels = 1024;
constexpr Eigen::Index kNumbers = 9;  // whose products are added up: 1, the X-ray's, the DRR's, six derivatives
constexpr std::size_t kProducts = kNumbers * (kNumbers + 1) / 2;
constexpr std::size_t kMiddleBytes = 7 * sizeof(float);

constexpr std::size_t kMaxGroups = 65535;  // what every OpenGL 4.5 allows along each axis

struct GlView {
  std::uint32_t first_pixel, first_compared, compared;
  float low, per_unit;
};

const char* variant_of(SimilarityKind kind) {
  switch (kind) {
    case SimilarityKind::kNcc: return "NCC";
    case SimilarityKind::kGradientCorrelation: return "GRADIENT_CORRELATION";
    case SimilarityKind::kStochasticRankCorrelation: return "RANK_CORRELATION";
    case SimilarityKind::kMutualInformation: return "MUTUAL_INFORMATION";
    case SimilarityKind::kNormalizedMutualInformation: return "NORMALIZED_MUTUAL_INFORMATION";
  }
  return "";
}

ShaderSource similarity_shader(SimilarityKind kind) {
  return {fmt::format("#define {}\n{}#line 1\n{}", variant_of(kind), kComparisonGlsl, kSimilarityComp),
          "registration/similarity/similarity.comp"};
}

ShaderSource sums_shader(const char* variant) {
  return {fmt::format("#define {}\n{}#line 1\n{}", variant, kComparisonGlsl, kCorrelationSumsComp),
          "registration/similarity/correlation_sums.comp"};
}

std::uint32_t lists_of(SimilarityKind kind) { return kind == SimilarityKind::kGradientCorrelation ? 2 : 1; }

using Sums = Eigen::Matrix<double, kNumbers, kNumbers>;

// The model of one list from its sums. The X-ray's values have no mean, and a norm of 1 unless all are 0.
QuadraticModel model_of(const Sums& sums) {
  constexpr Eigen::Index kMotions = 6;
  const double count = sums(0, 0), mean = count > 0.0 ? sums(2, 0) / count : 0.0;
  const double squares = sums(2, 2) - count * mean * mean;
  if (!(squares > 0.0 && sums(1, 1) > 0.0)) return no_correlation(kMotions);
  const double norm = std::sqrt(squares);
  const Eigen::VectorXd slopes = sums.block<kMotions, 1>(3, 0) / count;  // the mean ones
  return correlation_model(sums(2, 1) / norm, sums.block<kMotions, 1>(3, 1) / norm,
                           (sums.block<kMotions, 1>(3, 2) - count * mean * slopes) / squares,
                           (sums.block<kMotions, kMotions>(3, 3) - count * slopes * slopes.transpose()) / squares);
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
    : context_(context),
      kind_(common_kind(comparisons)),
      program_(context.program(similarity_shader(kind_))),
      view_count_(comparisons.size()) {
  std::vector<GlView> views;
  XraySide xray;
  for (const Comparison& comparison : comparisons) {
    views.push_back({.first_pixel = static_cast<std::uint32_t>(pixels_per_pose_),
                     .first_compared = static_cast<std::uint32_t>(xray.size()),
                     .compared = static_cast<std::uint32_t>(comparison.pixels_compared()),
                     .low = comparison.drr_range().low,
                     .per_unit = comparison.drr_range().per_unit});
    for (std::uint32_t list = 0; list < lists_of(kind_); ++list)
      for (std::uint32_t first = 0; first < views.back().compared; first += kTilePixels)
        tiles_.push_back({.view = static_cast<std::uint32_t>(views.size() - 1),
                          .list = list,
                          .first = first,
                          .end = std::min<std::uint32_t>(first + kTilePixels, views.back().compared)});
    xray.add(comparison);
    pixels_per_pose_ += comparison.pixels();
  }
  upload(views, views_);
  if (xray.bins.empty())
    upload(xray.values, xray_);
  else
    upload(xray.bins, xray_);
  upload(xray.pairs, pairs_);
  upload(tiles_, tile_buffer_);
  context_.check("uploading the X-rays");
}

void GlSimilarity::bind_views(const Buffer& line_integrals) const {
  line_integrals.bind(kLineIntegrals);
  views_.bind(kViews);
  xray_.bind(kXray);
  pairs_.bind(kPairs);
}

void GlSimilarity::dispatch(std::size_t poses, std::size_t per_pose) const {
  glUniform1ui(kViewCount, static_cast<GLuint>(view_count_));
  glUniform1ui(kPixelsPerPose, static_cast<GLuint>(pixels_per_pose_));
  for (std::size_t first = 0; first < poses; first += kMaxGroups) {
    glUniform1ui(kFirstPose, static_cast<GLuint>(first));
    glDispatchCompute(static_cast<GLuint>(std::min(kMaxGroups, poses - first)), static_cast<GLuint>(per_pose), 1);
  }
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
}

std::vector<std::vector<double>> GlSimilarity::of(const Buffer& line_integrals, std::size_t poses) {
  if (poses == 0) return {};
  context_.make_current();
  result_.reserve(poses * view_count_ * sizeof(float));
  program_.use();
  bind_views(line_integrals);
  result_.bind(kResult);
  dispatch(poses, view_count_);
  std::vector<float> similarities;
  result_.append_to(similarities, poses * view_count_);
  context_.check("comparing");

  std::vector<std::vector<double>> of_pose;
  for (auto first = similarities.begin(); first != similarities.end();
       first += static_cast<std::ptrdiff_t>(view_count_))
    of_pose.emplace_back(first, first + static_cast<std::ptrdiff_t>(view_count_));
  return of_pose;
}

std::vector<QuadraticModel> GlSimilarity::models(const Buffer& line_integrals, const Buffer& derivatives,
                                                 std::size_t poses) {
  if (!has_curvature(kind_)) throw std::logic_error("a similarity without curvature has no model on the GPU");
  context_.make_current();
  derivatives.bind(kDerivatives);
  if (kind_ == SimilarityKind::kStochasticRankCorrelation) {
    middles_.reserve(poses * view_count_ * kRankBins * kMiddleBytes);
    context_.program(sums_shader("RANK_MIDDLES")).use();
    bind_views(line_integrals);
    middles_.bind(kMiddles);
    dispatch(poses, view_count_);
  }
  sums_.reserve(poses * tiles_.size() * kProducts * sizeof(float));
  context_.program(sums_shader(variant_of(kind_))).use();
  bind_views(line_integrals);
  tile_buffer_.bind(kTiles);
  sums_.bind(kResult);
  glUniform1ui(kTileCount, static_cast<GLuint>(tiles_.size()));
  dispatch(poses, tiles_.size());
  std::vector<float> products;
  sums_.append_to(products, poses * tiles_.size() * kProducts);
  context_.check("comparing");

  std::vector<QuadraticModel> models(poses * view_count_, no_correlation(6));
  auto product = products.begin();
  for (std::size_t pose = 0; pose < poses; ++pose)
    for (auto tile = tiles_.begin(); tile != tiles_.end();) {
      const auto list_end = std::find_if(
          tile, tiles_.end(), [&](const Tile& other) { return other.view != tile->view || other.list != tile->list; });
      QuadraticModel& model = models[pose * view_count_ + tile->view];
      Sums sums = Sums::Zero();
      for (; tile != list_end; ++tile)
        for (Eigen::Index row = 0; row < kNumbers; ++row)
          for (Eigen::Index column = 0; column <= row; ++column) sums(row, column) += *product++;
      sums = sums.selfadjointView<Eigen::Lower>();
      model = weighted_sum(1.0, model, 1.0 / lists_of(kind_), model_of(sums));
    }
  return models;
}

}  // namespace isoshift
