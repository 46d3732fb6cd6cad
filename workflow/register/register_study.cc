#include "workflow/register/register_study.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <utility>

#include "base/json_file.h"
#include "base/output_folder.h"
#include "base/stopwatch.h"
#include "io/report/result_folder.h"
#include "registration/quality/limits.h"
#include "setup/couch_shift.h"
#include "workflow/register/same_setup.h"
#include "workflow/register/setup_result_of.h"
#include "workflow/register/start_pose.h"
#include "workflow/register/target_of.h"

namespace isoshift {
namespace {

// Accepted results are written; those for review, and those with a direction that nobody measured, only on request.
bool may_write_registration(const RegisterOptions& options, const SetupResult& result) {
  if (!result.unobservable_room.empty() && !options.accept_unobservable) return false;
  return result.verdict() == Verdict::kAccepted ||
         (result.verdict() == Verdict::kReview && options.write_reg_for_review);
}

// The pose that is written: the setup error along a direction that no view measured is taken as 0, and is an override.
Eigen::Isometry3d written_pose(const Study& study, const SetupResult& result, Notes& notes) {
  for (const Eigen::Vector3d& direction : result.unobservable_room)
    notes.overrides.push_back(
        fmt::format("spatial registration: the setup error along ({:.3f}), which was not measured, is taken as 0 by "
                    "--accept-unobservable",
                    fmt::join(direction, ", ")));
  return known_setup_error(result) * study.planned_room_from_patient;
}

SpatialRegistrationOptions registration_options(RegistrationSource source, const SetupResult& result) {
  if (!result.is_searched)
    return {.content_label = kLabelOfHand, .content_description = kHandDescription, .source = source};
  if (result.verdict() == Verdict::kAccepted) return {.source = source};
  return {.content_label = kLabelOfReview, .content_description = kReviewDescription, .source = source};
}

// A patient turned by more than a couch corrects may lie right, but an angle in a file on a wrong scale looks the same.
// A site whose action level has a rotation decides by that.
void doubt_large_rotation(SetupResult& result) {
  const ZxyAngles turn = couch_shift_for(result.setup_error, result.table).change;
  for (const auto& [name, angle_rad] : {std::pair("yaw", turn.z_rad), {"pitch", turn.x_rad}, {"roll", turn.y_rad}})
    if (std::abs(deg_from_rad(angle_rad)) > limits::kMostRotationDeg)
      result.findings.push_back(
          {.check = Check::kLargeRotation,
           .subject = name,
           .measures = {{.value = deg_from_rad(angle_rad), .limit = limits::kMostRotationDeg, .unit = "deg"}}});
}

}  // namespace

std::string write_registration(const RegisterOptions& options, const Study& study, const SetupResult& result,
                               const std::filesystem::path& path, Notes& notes) {
  if (!may_write_registration(options, result)) return "";
  return write_spatial_registration(study, written_pose(study, result, notes),
                                    registration_options(options.source, result), path, notes);
}

SetupResult register_loaded(const Study& study, const RegisterOptions& options, const std::optional<SiteRules>& site,
                            std::optional<Start> start, SharedWork& shared, Observer& observer) {
  TargetChoice choice = target_of(study, {options.target, site ? site->target : ""});
  const Surrogate surrogate = surrogate_of(study, choice.target, site ? site->surrogate : "", shared.bodies);
  choice.target.surrogate = surrogate.words;
  const RegistrationSetup setup(options.registration, study, beams_of(study), shared.renderers);
  const std::vector<FixedImage> images = prepared(study.xrays);
  const TargetRegistration registration(target_problem(study, options.registration, setup, choice, surrogate),
                                        setup.renderers(), setup.rendered_ct(), shared.bodies);
  const Eigen::Isometry3d setup_error = start ? start->setup_error : Eigen::Isometry3d::Identity();
  RegistrationResult found =
      registration.from(setup_error * study.planned_room_from_patient, images,
                        [&](std::string_view step, double share) { observer.progress(step, share); });

  SetupResult result = setup_result_of(study, images, options.registration, setup, choice.target, std::move(found));
  if (!site || !site->level || !site->level->rotation_deg) doubt_large_rotation(result);
  result.site = site;
  result.start = std::move(start);
  return result;
}

SetupResult register_study(const RegisterOptions& options, SharedWork& shared, Observer& observer) {
  const Stopwatch total;
  std::vector<std::filesystem::path> inputs = options.study.parts.paths();
  inputs.insert(inputs.end(), {options.start, options.truth, options.site});
  OutputFolder output(options.output, options.overwrite, inputs);
  const std::optional<SiteFile> site_file = named_site(options.site);
  const std::optional<SiteRules> site = chosen_site(site_file, options.anatomy);

  Notes notes;
  StudyOptions named = options.study;
  named.max_span_s = max_span_s_of(site_file);
  if (const auto failure = options.registration.rendering.failed_gpu())
    notes.warnings.push_back(fmt::format("{}; rendered on the CPU instead", *failure));
  const Study study = load(named, notes, observer, shared.cts);
  if (!options.truth.empty()) require_same_setup(read_json_file(options.truth).json, options.truth.string(), study);
  std::optional<Start> start;
  if (!options.start.empty()) start = read_start(options.start, study, options.source_isocenter, notes);
  const double seconds_load = total.seconds();
  SetupResult result = register_loaded(study, options, site, std::move(start), shared, observer);
  result.spatial_registration_uid =
      write_registration(options, study, result, output.path() / kRegistrationFile, notes);
  result.overrides = notes.overrides;
  result.left_aside = notes.left_aside;
  result.warnings = notes.warnings;
  result.seconds_load = seconds_load;
  result.seconds_total = total.seconds();
  write_result(result, output.path());
  output.commit();
  return result;
}

}  // namespace isoshift
