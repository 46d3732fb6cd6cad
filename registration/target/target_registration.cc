#include "registration/target/target_registration.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "base/error.h"
#include "drr/spot_check.h"
#include "registration/bodies/target_match.h"
#include "registration/quality/findings.h"
#include "registration/quality/limits.h"
#include "registration/target/region_check.h"
#include "setup/irradiated_field.h"

namespace isoshift {
namespace {

// A target near the edge of what a view shows is cut off with what could tell where it lies.
void doubt_at_edges_of_fields(std::span<const FixedImage> images, const Eigen::Vector3d& target_room_mm,
                              RegistrationResult& found) {
  for (std::size_t view = 0; view < images.size(); ++view) {
    const auto place_px = images[view].view.project(target_room_mm);
    if (!place_px) continue;
    const double inside_mm = inside_px(found.views[view].field, *place_px) / pixels_per_mm(images[view].view);
    if (inside_mm >= limits::kLeastInsideMm) continue;
    const Measure measure{.value = inside_mm, .limit = limits::kLeastInsideMm, .unit = "mm"};
    found.findings.push_back({.check = inside_mm < 0.0 ? Check::kTargetOutsideField : Check::kTargetAtEdgeOfField,
                              .view = name_of_view(images[view].label, view),
                              .measures = {measure}});
  }
}

void doubt_at_edges_of_rectangles(std::span<const FixedImage> images, const RectanglesByLabel& rectangles,
                                  const Eigen::Vector3d& target_room_mm, RegistrationResult& found) {
  for (const FixedImage& image : images) {
    const auto of_view = rectangles.find(image.label);
    const auto place_px = image.view.project(target_room_mm);
    if (of_view == rectangles.end() || !place_px) continue;
    const PixelRectangle& r = of_view->second;
    const double inside_mm = std::min({place_px->x() - r.first_column, r.last_column - place_px->x(),
                                       place_px->y() - r.first_row, r.last_row - place_px->y()}) /
                             pixels_per_mm(image.view);
    if (inside_mm >= limits::kLeastInsideMm) continue;
    const Measure measure{.value = std::abs(inside_mm), .limit = limits::kLeastInsideMm, .unit = "mm"};
    found.findings.push_back(
        {.check = inside_mm < 0.0 ? Check::kTargetOutsideRectangle : Check::kTargetAtEdgeOfRectangle,
         .view = image.label,
         .measures = {measure}});
  }
}

}  // namespace

TargetRegistration::TargetRegistration(TargetProblem problem, const RendererPyramid& renderers,
                                       const Volume<float>& rendered_ct, BodyStore& bodies)
    : problem_(std::move(problem)), renderers_(renderers), rendered_ct_(rendered_ct), bodies_(bodies) {
  const PlannedPatient& patient = problem_.patient;
  RegistrationOptions& options = problem_.options;
  options.target_patient_mm = patient.room_from_patient.inverse() * problem_.target.center_room_mm;
  if (!options.region)
    options.region =
        std::make_shared<const ProjectedRegion>(region_within({}, {}, problem_.chosen, problem_.margin_mm,
                                                              *patient.ct_hu, problem_.rendering.model.threshold_hu)
                                                    .projected);
  for (std::string& doubt :
       region_doubts(patient, problem_.chosen, problem_.margin_mm, problem_.target, problem_.surrogate.drawn))
    region_findings_.push_back({.check = Check::kRegion, .words = std::move(doubt)});
}

const BentPatient& TargetRegistration::bent_patient() const {
  std::call_once(bent_once_, [&] {
    const auto& ct_hu = problem_.patient.ct_hu;
    const Surrogate& surrogate = problem_.surrogate;
    PatientBodies parts =
        patient_bodies(*bodies_.map(ct_hu), *bodies_.masks(ct_hu), *problem_.options.target_patient_mm);
    if (surrogate.drawn) {
      parts.named_carriers = shares_of_bone_in(parts, *surrogate.drawn);
      if (parts.named_carriers.empty())
        throw Error(fmt::format("surrogate: the CT shows no bone in it ({})", surrogate.words));
    }
    bent_.emplace(*ct_hu, problem_.rendering.model, problem_.rendering.beams, std::move(parts), problem_.target,
                  problem_.others ? problem_.others() : std::vector<Target>());
  });
  return *bent_;
}

const TargetRegistration::OwnBall& TargetRegistration::own_ball() const {
  std::call_once(ball_once_, [&] {
    const Rendering& rendering = problem_.rendering;
    ChosenRegion region = ball_about(*problem_.options.target_patient_mm, kAboutTargetMm, problem_.chosen,
                                     problem_.margin_mm, *problem_.patient.ct_hu, rendering.model.threshold_hu);
    ball_.emplace();
    if (region.rendered_ct)
      ball_->renderers.emplace(rendering.kind, *region.rendered_ct, rendering.model, rendering.beams,
                               rendering.options);
    ball_->region = std::move(region);
  });
  return *ball_;
}

// Whether what a GPU rendered of the patient is what the CPU computes.
void TargetRegistration::check_spots(std::span<const FixedImage> images, RegistrationResult& found) const {
  if (renderers_.finest().kind() != RendererKind::kRaycast) return;
  std::vector<XrayView> views;
  for (const FixedImage& image : images) views.push_back(image.view);
  const SpotCheck spots =
      check_rays(renderers_.finest(), rendered_ct_, problem_.rendering.model, views, found.actual_room_from_patient);
  found.compared_with_cpu = spots.words();
  if (spots.failure) found.findings.push_back({.check = Check::kGpuDiffers, .words = *spots.failure});
}

// A region that a person chose may hold anatomy that has moved against the target, or not the target at all; bodies
// then have no answer. The target's own surroundings decide, not those within the region.
void TargetRegistration::check_against_region(std::span<const FixedImage> images, RegistrationResult& found) const {
  const Eigen::Vector3d target_room_mm = target_found_room_mm(problem_.options, found);
  std::vector<Stage> stages = problem_.options.stages;
  stages.back().similarity = SimilarityKind::kGradientCorrelation;  // a part of the CT is rendered
  const auto wanted_room_mm = place_wanted_near_target(
      own_ball().renderers ? *own_ball().renderers : renderers_,
      {.images = {images.begin(), images.end()}, .region = own_ball().region.projected}, found.actual_room_from_patient,
      target_room_mm, {.stages = stages, .dof = problem_.options.dof});
  if (!wanted_room_mm) {
    found.findings.push_back(
        {.check = Check::kRegionNotConfirmed, .measures = {{.value = kAboutTargetMm, .unit = "mm"}}});
    return;
  }
  const double elsewhere_mm = (*wanted_room_mm - target_room_mm).norm();
  if (elsewhere_mm > limits::kMostFromRegionMm)
    found.findings.push_back({.check = Check::kRegionContradicted,
                              .measures = {{.value = elsewhere_mm, .limit = limits::kMostFromRegionMm, .unit = "mm"},
                                           {.value = kAboutTargetMm, .unit = "mm"}}});
}

RegistrationResult TargetRegistration::from(const Eigen::Isometry3d& start_room_from_patient,
                                            std::span<const FixedImage> images, const StepProgress& progress,
                                            std::optional<std::uint64_t> seed) const {
  RegistrationOptions options = problem_.options;
  options.seed = seed.value_or(options.seed);
  const auto step = [&](std::string_view name) {
    return [&progress, name](double share) {
      if (progress) progress(name, share);
    };
  };
  RegistrationResult found = register_views(renderers_, images, start_room_from_patient, options, step("Registering"));
  step("Registering")(1.0);
  check_spots(images, found);
  if (may_have_bent(options, images, found) || may_target_lie_elsewhere(renderers_, images, options, found))
    register_bodies(bent_patient(), images, problem_.patient.room_from_patient, options, found,
                    step("Registering the target"));
  const bool is_part_chosen = options.region->has_volume() || !options.rectangles.empty();
  if (found.verdict() == Verdict::kAccepted && is_part_chosen) check_against_region(images, found);
  std::ranges::copy(region_findings_, std::back_inserter(found.findings));
  doubt_at_edges_of_rectangles(images, options.rectangles, target_found_room_mm(options, found), found);
  doubt_at_edges_of_fields(images, target_found_room_mm(options, found), found);
  std::ranges::copy(problem_.findings, std::back_inserter(found.findings));
  if (problem_.surrogate.doubt)
    found.findings.push_back({.check = Check::kSurrogate, .words = *problem_.surrogate.doubt});
  return found;
}

}  // namespace isoshift
