#include "workflow/scout/register_scout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "geometry/rotation.h"
#include "io/dicom/ct_series.h"
#include "io/study/session.h"
#include "io/study/study_files.h"
#include "registration/evaluate.h"
#include "registration/pose_parameters.h"
#include "registration/presets.h"
#include "registration/quality/judge.h"
#include "registration/region.h"

namespace isoshift {
namespace {

using Eigen::Vector3d;

constexpr int kStarts = 10;
constexpr double kMostRad = rad_from_deg(3.0);  // of the displaced starts' rotations
// The side on which the tube stood matches clearly better: of the head's scout 0.1 of gradient correlation.
constexpr double kClearlyBetter = 0.02;
constexpr double kSeenMm = 1.0, kSeenRad = rad_from_deg(1.0);  // two sigma

CtSeries read_ct(const ScoutRequest& request, Notes& notes, Observer& observer) {
  const StudyFiles files = scan_study({request.ct});
  if (files.cts.size() != 1)
    throw Error(fmt::format("{}: holds {} CT series, expected one", request.ct.string(), files.cts.size()));
  return read_ct_series(files.cts.front().files, request.allowed, notes,
                        [&](std::size_t done, std::size_t total) { observer.progress("Reading the CT", done, total); });
}

void check_same_patient(const CtSeries& ct, const Scout& scout, const ScoutRequest& request, Notes& notes) {
  std::vector<Finding> findings = patient_findings(ct.identity, scout.identity, request.scout.string(), "the CT");
  if (scout.frame_of_reference_uid != ct.frame_of_reference_uid)
    findings.push_back(
        {"for-mismatch", fmt::format("{}: {} is not that of the CT, so nothing says where the scout lies",
                                     request.scout.string(), described(DCM_FrameOfReferenceUID))});
  settle(findings, request.allowed, notes);
}

Vector3d center_of(const Volume<float>& ct) {
  return ct.patient_from_voxel * Vector3d(0.5 * (ct.size.cast<double>().array() - 1.0));
}

// The axes of the room are those of the patient, its origin the center of the CT.
class ScoutScene {
 public:
  ScoutScene(const ScoutRequest& request, const CtSeries& ct, const Scout& scout)
      : scout_(scout),
        center_(center_of(ct.hu)),
        planned_(Eigen::Translation3d(-center_)),
        renderers_(request.rendering.kind(), ct.hu, request.rendering.model(), std::array{Beam::kKilovoltage},
                   request.rendering.options()),
        region_({.volume = {}, .excluded = {}, .cut_ends = beyond_the_ct(ct.hu, request.rendering.threshold_hu)}),
        options_(preset("setup")) {
    options_.region = &region_;
    options_.seed = request.seed;
  }
  ScoutScene(const ScoutScene&) = delete;
  ScoutScene& operator=(const ScoutScene&) = delete;

  const Vector3d& center_patient_mm() const { return center_; }

  FixedImage image(TubeSide side) const { return prepare(scout_.xray(side, planned_)); }

  // From the nominal pose, or from one displaced by this.
  RegistrationResult registered(const FixedImage& image, const Eigen::Isometry3d& displaced, bool with_checks) {
    RegistrationOptions options = options_;
    options.check_alternatives = with_checks;
    return register_views(renderers_, std::span(&image, 1), displaced * planned_, options);
  }

  Eigen::Isometry3d offset_of(const RegistrationResult& found) const {
    return found.actual_room_from_patient * planned_.inverse();
  }

  // The rules of every registration, for what a single view can tell.
  void judge_what_is_seen(const std::array<ScoutAxis, 6>& axes, RegistrationResult& found) const {
    found.unobservable_room.clear();
    for (StageReport& stage : found.stages) stage.spread_mm = stage.spread_rad = std::nullopt;
    for (Eigen::Index axis = 0; axis < 6 && found.uncertainty; ++axis)
      if (!axes[static_cast<std::size_t>(axis)].is_seen) {
        found.uncertainty->covariance.row(axis).setZero();
        found.uncertainty->covariance.col(axis).setZero();
      }
    judge(parameters_from_setup_error(offset_of(found)), options_, found);
  }

 private:
  const Scout& scout_;
  Vector3d center_;
  Eigen::Isometry3d planned_;
  RendererPyramid renderers_;
  ProjectedRegion region_;
  RegistrationOptions options_;
};

std::array<double, 6> axes_of(const Eigen::Isometry3d& offset) {
  const Vector3d turned = rotation_vector(offset.linear());
  return {
      offset.translation().x(), offset.translation().y(), offset.translation().z(), turned.x(), turned.y(), turned.z()};
}

std::array<ScoutAxis, 6> scout_axes(const Eigen::Isometry3d& offset, const std::optional<Uncertainty>& uncertainty,
                                    const Vector3d& along_rays) {
  std::array<ScoutAxis, 6> axes;
  const std::array<double, 6> offsets = axes_of(offset);
  for (std::size_t n = 0; n < 6; ++n) {
    const auto axis = static_cast<Eigen::Index>(n);
    axes[n].offset = offsets[n];
    axes[n].sigma = uncertainty ? std::sqrt(uncertainty->covariance(axis, axis)) : INFINITY;
    const bool is_depth = n < 3 && std::abs(along_rays[axis]) > 0.5;
    axes[n].is_seen = !is_depth && 2.0 * axes[n].sigma <= (n < 3 ? kSeenMm : kSeenRad);
  }
  return axes;
}

}  // namespace

ScoutRegistration register_scout(const ScoutRequest& request, Observer& observer) {
  ScoutRegistration result;
  request.rendering.check();
  const Scout scout = read_scout(request.scout, request.distances, result.notes);
  const std::array<TubeSide, 2> sides = scout.possible_sides();
  if (request.tube && std::ranges::find(sides, *request.tube) == sides.end())
    throw UsageError(fmt::format("--tube {}: the scout's plane has its sides {} and {}", to_string(*request.tube),
                                 to_string(sides[0]), to_string(sides[1])));
  const CtSeries ct = read_ct(request, result.notes, observer);
  check_same_patient(ct, scout, request, result.notes);
  ScoutScene scene(request, ct, scout);

  const std::array images = {scene.image(sides[0]), scene.image(sides[1])};
  std::array<RegistrationResult, 2> found;
  for (std::size_t n = 0; n < 2; ++n) {
    found[n] = scene.registered(images[n], Eigen::Isometry3d::Identity(), true);
    observer.progress("Registering", n + 1, kStarts + 2);
  }
  const auto match_of = [&](std::size_t n) { return found[n].views.front().similarity_final; };
  const std::size_t better = match_of(1) > match_of(0) ? 1 : 0;
  const std::size_t chosen = request.tube ? static_cast<std::size_t>(*request.tube == sides[1]) : better;
  RegistrationResult& answer = found[chosen];
  result.tube = sides[chosen];
  result.match = match_of(chosen);
  result.match_from_other_side = match_of(1 - chosen);
  const FixedImage& image = images[chosen];
  result.axes = scout_axes(scene.offset_of(answer), answer.uncertainty, image.view.central_direction_room());
  scene.judge_what_is_seen(result.axes, answer);
  if (!(result.match >= result.match_from_other_side + kClearlyBetter))
    answer.demote(
        Verdict::kReview,
        fmt::format("with the tube on the {} side the scout matches {} ({:.3f}; on the {} side {:.3f})",
                    to_string(sides[1 - chosen]), result.match < result.match_from_other_side ? "better" : "as well",
                    result.match_from_other_side, to_string(result.tube), result.match));

  const std::array<double, 6> ends = axes_of(scene.offset_of(answer));
  const std::vector<StartPose> starts =
      start_poses(Eigen::Isometry3d::Identity(), {.distance_mm = ScoutRegistration::kStartMm,
                                                  .max_rotation_rad = kMostRad,
                                                  .count = kStarts,
                                                  .seed = request.seed});
  for (const StartPose& start : starts) {
    const std::array<double, 6> other = axes_of(scene.offset_of(scene.registered(image, start.setup_error, false)));
    for (std::size_t n = 0; n < 6; ++n)
      result.axes[n].repeatability = std::max(result.axes[n].repeatability, std::abs(other[n] - ends[n]));
    observer.progress("Registering", static_cast<std::size_t>(++result.starts) + 2, kStarts + 2);
  }
  result.verdict = answer.verdict;
  result.reasons = answer.reasons;
  result.center_patient_mm = scene.center_patient_mm();
  result.renderer = answer.renderer;
  result.device = answer.device;
  result.scout_sha256 = scout.sha256;
  result.ct_series_instance_uid = ct.series_instance_uid;
  return result;
}

}  // namespace isoshift
