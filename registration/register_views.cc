#include "registration/register_views.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/stopwatch.h"
#include "registration/objective.h"
#include "registration/pose_parameters.h"
#include "registration/quality/findings.h"

namespace isoshift {
namespace {

void round_to_eight_bit(FixedImage& image) {
  std::vector<float> in_field;
  for (std::size_t n = 0; n < image.field.pixels.size(); ++n)
    if (image.field.pixels[n] != 0) in_field.push_back(image.line_integral.pixels[n]);
  const Range range = range_of(in_field);
  for (float& value : image.line_integral.pixels) value = std::round(255.0F * std::clamp(range(value), 0.0F, 1.0F));
}

// Before anything is searched: the CT must appear in every view as planned.
void require_visible(const RendererPyramid& renderers, const FixedViews& views, const Eigen::Isometry3d& planned) {
  constexpr double kPixelMm = 5.0;
  const std::vector<FixedImage> images = views.reduced_to(kPixelMm, planned, 0.0);
  for (const FixedImage& image : images) {
    const RenderResult drr = renderers.with_voxels_up_to(kPixelMm).render(std::span(&image.view, 1),
                                                                          std::span(&planned, 1), PixelSet::all());
    require_not_empty(drr.line_integrals(0, 0), image.label);
  }
}

// Similarity before and after, and whether the parts of each view agree.
void report_views(const RendererPyramid& renderers, const FixedViews& views, const Eigen::Isometry3d& start,
                  const Stage& last_stage, RegistrationResult& result) {
  const Eigen::Isometry3d& found = result.actual_room_from_patient;
  const std::vector<FixedImage> level = views.reduced_to(2.0 * last_stage.pixel_mm, found, 0.0);
  Objective gradient_correlation(renderers.with_voxels_up_to(2.0 * last_stage.voxel_mm), level, found,
                                 {.similarity = SimilarityKind::kGradientCorrelation});
  const std::array poses = {start, found};
  const auto similarity = gradient_correlation.per_view(poses);
  std::vector<ViewConsistency> consistency = regional_consistency(renderers, views, found);
  for (std::size_t view = 0; view < consistency.size(); ++view) {
    result.views.push_back({.label = level[view].label,
                            .similarity_start = similarity[0][view],
                            .similarity_final = similarity[1][view],
                            .has_all_excluded = level[view].has_all_excluded,
                            .field = level[view].irradiated,
                            .consistency = std::move(consistency[view])});
  }
}

void report_uncertainty(const RendererPyramid& renderers, const FixedViews& views, const RegistrationOptions& options,
                        RegistrationResult& result) {
  const Stage& last = options.stages.back();
  const Eigen::Isometry3d& found = result.actual_room_from_patient;
  Objective gradient_correlation(renderers.with_voxels_up_to(last.voxel_mm),
                                 views.reduced_to(last.pixel_mm, found, 0.0), found,
                                 {.similarity = SimilarityKind::kGradientCorrelation,
                                  .pixel_fraction = last.pixel_fraction,
                                  .min_pixels = static_cast<std::size_t>(last.min_pixels),
                                  .seed = options.seed});
  result.uncertainty = estimated_uncertainty(gradient_correlation, found,
                                             {.translation_only = options.dof == Dof::kTranslation,
                                              .voxel_mm = renderers.voxel_mm(),
                                              .has_volume_of_interest = views.region.has_volume()});
  for (const StageReport& stage : result.stages)
    if (result.uncertainty && stage.spread_mm)
      result.uncertainty = widened_to_spread(*result.uncertainty, *stage.spread_mm, *stage.spread_rad);
  result.by_imagers = options.by_imagers;
  if (result.uncertainty && result.by_imagers) result.uncertainty->covariance += result.by_imagers->covariance;
}

}  // namespace

void RegistrationOptions::check() const {
  if (!(bound_mm > 0.0)) throw UsageError(fmt::format("bound_mm is {}, expected positive", bound_mm));
  if (!(bound_rad > 0.0)) throw UsageError(fmt::format("bound_rad is {}, expected positive", bound_rad));
  if (stages.empty()) throw UsageError("stages is empty, expected at least one");
}

FixedViews compared_views(const RegistrationOptions& options, std::span<const FixedImage> images) {
  static const ProjectedRegion everything;
  return {.images = restricted_to(options.rectangles, images),
          .region = options.region != nullptr ? *options.region : everything};
}

RegistrationResult register_views(const RendererPyramid& renderers, std::span<const FixedImage> images,
                                  const Eigen::Isometry3d& start_room_from_patient, const RegistrationOptions& options,
                                  const SearchProgress& progress) {
  options.check();
  const Stopwatch watch;
  FixedViews fixed = compared_views(options, images);
  std::vector<XrayView> views;
  for (FixedImage& image : fixed.images) {
    views.push_back(image.view);
    if (options.eight_bit_xrays) round_to_eight_bit(image);
  }
  require_visible(renderers, fixed, start_room_from_patient);

  const SearchResult found =
      options.is_searched ? search(renderers, fixed, start_room_from_patient, options, progress)
                          : SearchResult{.parameters = parameters_from_setup_error(Eigen::Isometry3d::Identity())};
  RegistrationResult result;
  result.renderer = to_string(renderers.finest().kind());
  result.device = renderers.finest().device();
  result.actual_room_from_patient = setup_error_from_parameters(found.parameters) * start_room_from_patient;
  result.stages = found.stages;
  result.seconds_rendering = found.seconds_rendering;
  result.seconds_similarity = found.seconds_similarity;
  const Stage& last = options.stages.back();
  report_views(renderers, fixed, start_room_from_patient, last, result);
  report_uncertainty(renderers, fixed, options, result);
  if (options.is_searched && options.check_alternatives)
    result.alternatives = compare_alternatives(renderers, fixed, start_room_from_patient, options, found);
  if (options.check_vertebrae)
    std::ranges::copy(compare_vertebrae(renderers, fixed, start_room_from_patient, options, found),
                      std::back_inserter(result.alternatives));
  std::vector<LeftOutView> left_out;
  if (options.is_searched) left_out = leave_out_views(renderers, fixed, start_room_from_patient, options, found);
  for (std::size_t view = 0; view < left_out.size(); ++view) result.views[view].left_out = left_out[view];

  Contradictions found_alone =
      contradictions(renderers, fixed, start_room_from_patient, result.actual_room_from_patient, last, options.dof);
  for (std::size_t view = 0; view < found_alone.of_views.size(); ++view)
    result.views[view].contradiction = found_alone.of_views[view];
  for (std::size_t view = 0; view < found_alone.wanted.size(); ++view)
    result.views[view].wanted = found_alone.wanted[view];
  result.turn = std::move(found_alone.turn);
  result.wanted_by_views = std::move(found_alone.wanted_room_from_patient);

  result.unobservable_room = unobservable_directions(views);
  result.findings = findings_about(found.parameters, options, result);
  result.seconds = watch.seconds();
  return result;
}

}  // namespace isoshift
