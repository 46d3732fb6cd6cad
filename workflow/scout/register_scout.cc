#include "workflow/scout/register_scout.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "geometry/rotation.h"
#include "io/dicom/ct_series.h"
#include "io/study/session.h"
#include "io/study/study_files.h"
#include "registration/evaluate.h"
#include "registration/presets.h"
#include "registration/region.h"
#include "workflow/scout/scout_picture.h"

namespace isoshift {
namespace {

using Eigen::Vector3d;

constexpr int kStarts = 10;
constexpr double kMostRad = rad_from_deg(3.0);  // of the displaced starts' rotations
// From the side on which the tube did not stand, this much more is left unexplained (1 - gradient correlation), and
// that is more than noise: of the head's scout 1.36 times as much, of simulated heads, which are nearly symmetric, 20
// times.
constexpr double kSideMargin = 1.1, kSideNoise = 0.005;
constexpr double kSeenMm = 1.0, kSeenRad = rad_from_deg(1.0);  // two sigma
constexpr double kLeastOverlapMm = 20.0;
constexpr double kMostWidth = 0.025;  // of 1; of the head's scout 0.013
// Of a scout that was cut to one side of its middle 5.6 degrees are found, of the head's 0.1.
constexpr double kMostAboutTable = rad_from_deg(2.0);
constexpr std::array kAxisNames = {"translation to the left", "posterior translation",    "superior translation",
                                   "rotation about the left", "rotation about posterior", "rotation about superior"};

void check_renderer(RendererKind kind) {
  constexpr std::array kCan = {RendererKind::kCpu, RendererKind::kRaycast, RendererKind::kSiddon,
                               RendererKind::kTrilinear};
  if (std::ranges::find(kCan, kind) == kCan.end())
    throw UsageError(
        fmt::format("--renderer {}: cannot render scouts; cpu, raycast, siddon and trilinear can", to_string(kind)));
}

Scout scout_of(const ScoutRequest& request, Notes& notes) {
  if (std::filesystem::is_directory(request.scout))
    throw Error(fmt::format("{}: is a folder, expected the file of a scout (the CT is named first, then its scout)",
                            request.scout.string()));
  Scout scout = read_scout(request.scout, request.distances, notes);
  const std::array<TubeSide, 2> sides = scout.possible_sides();
  if (request.tube && std::ranges::find(sides, *request.tube) == sides.end())
    throw UsageError(fmt::format("--tube {}: the scout's plane has its sides {} and {}", to_string(*request.tube),
                                 to_string(sides[0]), to_string(sides[1])));
  return scout;
}

CtSeries read_ct(const ScoutRequest& request, Notes& notes, Observer& observer) {
  const StudyFiles files = scan_study({request.ct});
  if (files.cts.empty())
    throw Error(fmt::format("{}: holds no CT series (the CT is named first, then its scout)", request.ct.string()));
  if (files.cts.size() != 1)
    throw Error(fmt::format("{}: holds {} CT series, expected one", request.ct.string(), files.cts.size()));
  return read_ct_series(files.cts.front().files, request.allowed, notes,
                        [&](std::size_t done, std::size_t total) { observer.progress("Reading the CT", done, total); });
}

void check_same_patient(const CtSeries& ct, const Scout& scout, const ScoutRequest& request, Notes& notes) {
  std::vector<FailedCheck> findings =
      patient_findings({&ct.identity, "the CT"}, {&scout.identity, request.scout.string()});
  if (scout.frame_of_reference_uid != ct.frame_of_reference_uid)
    findings.push_back(
        {"for-mismatch", fmt::format("{}: {} is not that of the CT, so nothing says where the scout lies",
                                     request.scout.string(), described(DCM_FrameOfReferenceUID))});
  settle(findings, request.allowed, notes);
  if (!scout.patient_position.empty() && !ct.patient_position.empty() && scout.patient_position != ct.patient_position)
    notes.warnings.push_back(fmt::format(
        "{}: {} is {}, that of the CT {}: the patient may have been turned between scout and CT",
        request.scout.string(), described(DCM_PatientPosition), scout.patient_position, ct.patient_position));
}

std::array<Vector3d, 8> corners_of(const Volume<float>& ct) {
  std::array<Vector3d, 8> corners;
  for (std::size_t n = 0; n < corners.size(); ++n)
    corners[n] =
        ct.patient_from_voxel * Vector3d((n & 1) != 0 ? ct.size.x() - 1 : 0, (n & 2) != 0 ? ct.size.y() - 1 : 0,
                                         (n & 4) != 0 ? ct.size.z() - 1 : 0);
  return corners;
}

// From least to most along the table, of the patient's z.
std::pair<double, double> extent_of(const Scout& scout) {
  const double first = scout.first_pixel_patient_mm.z();
  return std::minmax({first, first + (scout.values.rows - 1) * scout.row_step_patient_mm.z()});
}

void check_overlap(const CtSeries& ct, const Scout& scout, const ScoutRequest& request) {
  const auto z = [](const Vector3d& corner) { return corner.z(); };
  const std::array<Vector3d, 8> corners = corners_of(ct.hu);
  const double ct_least = std::ranges::min(corners, {}, z).z(), ct_most = std::ranges::max(corners, {}, z).z();
  const auto [least, most] = extent_of(scout);
  if (std::min(most, ct_most) - std::max(least, ct_least) < kLeastOverlapMm)
    throw Error(
        fmt::format("{}: shows z from {:.1f} to {:.1f} mm, and the CT lies from {:.1f} to {:.1f} mm: they must "
                    "have at least {:.0f} mm of the patient in common",
                    request.scout.string(), least, most, ct_least, ct_most, kLeastOverlapMm));
}

// The axes of the room are those of the patient, its origin the center of the CT.
class ScoutScene {
 public:
  ScoutScene(const ScoutRequest& request, const CtSeries& ct, const Scout& scout)
      : scout_(scout),
        center_(ct.hu.center_mm()),
        ct_corners_patient_mm_(corners_of(ct.hu)),
        planned_(Eigen::Translation3d(-center_)),
        renderers_(request.rendering.kind(), ct.hu, request.rendering.model(), std::array{Beam::kKilovoltage},
                   request.rendering.options()),
        region_(std::make_shared<const ProjectedRegion>(RegionOfInterest{
            .volume = {}, .excluded = {}, .cut_ends = beyond_the_ct(ct.hu, request.rendering.threshold_hu)})),
        options_(preset("setup")) {
    options_.region = region_;
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

  ViewPicture picture(const FixedImage& image, const RegistrationResult& found) const {
    FixedImage compared = image;
    region_->restrict(compared, found.actual_room_from_patient, 0.0);
    return scout_picture(compared, renderers_.finest(), scout_.column_step_patient_mm.norm(),
                         {planned_, found.actual_room_from_patient}, ct_corners_patient_mm_);
  }

 private:
  const Scout& scout_;
  Vector3d center_;
  std::array<Vector3d, 8> ct_corners_patient_mm_;
  Eigen::Isometry3d planned_;
  RendererPyramid renderers_;
  std::shared_ptr<const ProjectedRegion> region_;
  RegistrationOptions options_;
};

std::array<double, 6> axes_of(const Eigen::Isometry3d& offset) {
  const Vector3d turned = rotation_vector(offset.linear());
  return {
      offset.translation().x(), offset.translation().y(), offset.translation().z(), turned.x(), turned.y(), turned.z()};
}

std::array<ScoutAxis, 6> scout_axes(const Eigen::Isometry3d& offset, const std::optional<Uncertainty>& uncertainty,
                                    std::size_t along_rays) {
  std::array<ScoutAxis, 6> axes;
  const std::array<double, 6> offsets = axes_of(offset);
  for (std::size_t n = 0; n < 6; ++n) {
    const auto axis = static_cast<Eigen::Index>(n);
    axes[n].offset = offsets[n];
    axes[n].sigma = uncertainty ? std::sqrt(uncertainty->covariance(axis, axis)) : INFINITY;
    axes[n].is_seen = n != along_rays && 2.0 * axes[n].sigma <= (n < 3 ? kSeenMm : kSeenRad);
  }
  return axes;
}

// The patient's axis along which the rays run.
std::size_t axis_of_rays(const XrayView& view) {
  Eigen::Index axis = 0;
  view.central_direction_room().cwiseAbs().maxCoeff(&axis);
  return static_cast<std::size_t>(axis);
}

// What is found of every registration and holds for a single view, which does not see depth and has axes of its own to
// judge (check_axes()). The room's axes are here the patient's, and are called so.
std::vector<Finding> that_hold_for_one_view(std::vector<Finding> findings) {
  constexpr std::array kOfSeveralViews = {Check::kUnobservable, Check::kStartsEndApart, Check::kUncertainTarget,
                                          Check::kUncertainAxis};
  std::erase_if(findings, [&](const Finding& finding) {
    return std::ranges::find(kOfSeveralViews, finding.check) != kOfSeveralViews.end();
  });
  for (Finding& finding : findings)
    for (std::size_t n = 0; n < kAxisNames.size(); ++n)
      if (finding.subject == axis_of_room(n)) finding.subject = kAxisNames[n];
  return findings;
}

// What one view must tell, and tell alike from every start. Of a rejected result no number is shown, and where the
// images do not determine the pose, the verdict says so already.
void check_axes(const ScoutRegistration& scout, std::size_t along_rays, double sad_mm, RegistrationResult& found) {
  if (!found.uncertainty || found.verdict() == Verdict::kRejected) return;
  for (std::size_t n = 0; n < scout.axes.size(); ++n) {
    const ScoutAxis& axis = scout.axes[n];
    const bool must_be_seen = n < 3 ? n != along_rays : n == along_rays + 3;
    const auto against_limit = [n](double value) {
      return n < 3 ? Measure{.value = value, .limit = kSeenMm, .unit = "mm"}
                   : Measure{.value = deg_from_rad(value), .limit = deg_from_rad(kSeenRad), .unit = "deg"};
    };
    if (must_be_seen && !axis.is_seen)
      found.findings.push_back(
          {.check = Check::kUncertainAxis, .subject = kAxisNames[n], .measures = {against_limit(2.0 * axis.sigma)}});
    if (axis.is_seen && !(axis.repeatability <= (n < 3 ? kSeenMm : kSeenRad)))
      found.findings.push_back({.check = Check::kOtherStartsEndApart,
                                .subject = kAxisNames[n],
                                .measures = {against_limit(axis.repeatability)}});
  }
  if (!(std::abs(scout.width - 1.0) <= kMostWidth))
    found.findings.push_back(
        {.check = Check::kScoutWidth, .measures = {{.value = scout.width, .limit = 1.0 + kMostWidth, .unit = ""}}});
  const ScoutAxis& about_table = scout.axes[5];
  if (!(std::abs(about_table.offset) <= std::max(kMostAboutTable, 2.0 * about_table.sigma)))
    found.findings.push_back(
        {.check = Check::kScoutTurned,
         .measures = {
             {.value = deg_from_rad(about_table.offset), .limit = deg_from_rad(kMostAboutTable), .unit = "deg"},
             {.value = sad_mm * std::abs(std::tan(about_table.offset)), .unit = "mm"}}});
}

void check_side(const ScoutRegistration& scout, TubeSide other, RegistrationResult& found) {
  if (!(1.0 - scout.match_from_other_side >= kSideMargin * (1.0 - scout.match) &&
        scout.match >= scout.match_from_other_side + kSideNoise))
    found.findings.push_back(
        {.check = Check::kTubeSide,
         .subject = std::string(to_string(other)),
         .measures = {{.value = scout.match_from_other_side, .unit = ""}, {.value = scout.match, .unit = ""}}});
}

// From displaced starts.
void measure_repeatability(ScoutScene& scene, const FixedImage& image, const RegistrationResult& answer,
                           std::uint64_t seed, Observer& observer, ScoutRegistration& result) {
  const std::array<double, 6> ends = axes_of(scene.offset_of(answer));
  const std::vector<StartPose> starts = start_poses(
      Eigen::Isometry3d::Identity(),
      {.distance_mm = ScoutRegistration::kStartMm, .max_rotation_rad = kMostRad, .count = kStarts, .seed = seed});
  for (const StartPose& start : starts) {
    const std::array<double, 6> other = axes_of(scene.offset_of(scene.registered(image, start.setup_error, false)));
    for (std::size_t n = 0; n < 6; ++n)
      result.axes[n].repeatability = std::max(result.axes[n].repeatability, std::abs(other[n] - ends[n]));
    observer.progress("Registering", static_cast<std::size_t>(++result.starts) + 2, kStarts + 2);
  }
}

}  // namespace

ScoutRegistration register_scout(const ScoutRequest& request, Observer& observer) {
  ScoutRegistration result;
  request.rendering.check();
  check_renderer(request.rendering.kind());
  const Scout scout = scout_of(request, result.notes);
  const std::array<TubeSide, 2> sides = scout.possible_sides();
  const CtSeries ct = read_ct(request, result.notes, observer);
  check_same_patient(ct, scout, request, result.notes);
  check_overlap(ct, scout, request);
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
  const std::size_t along_rays = axis_of_rays(image.view);
  result.axes = scout_axes(scene.offset_of(answer), answer.uncertainty, along_rays);
  const ScoutAxis& depth = result.axes[along_rays];
  const double farther_mm = depth.offset * image.view.central_direction_room()[static_cast<Eigen::Index>(along_rays)];
  result.width = scout.sad_mm / (scout.sad_mm + farther_mm);
  result.width_sigma = depth.sigma / scout.sad_mm;
  answer.findings = that_hold_for_one_view(std::move(answer.findings));
  check_side(result, sides[1 - chosen], answer);
  measure_repeatability(scene, image, answer, request.seed, observer, result);
  check_axes(result, along_rays, scout.sad_mm, answer);
  result.verdict = answer.verdict();
  result.reasons = answer.reasons();
  result.center_patient_mm = scene.center_patient_mm();
  result.renderer = answer.renderer;
  result.device = answer.device;
  result.patient = ct.identity;
  result.ct_series_instance_uid = ct.series_instance_uid;
  result.frame_of_reference_uid = ct.frame_of_reference_uid;
  result.scout_sop_instance_uid = scout.sop_instance_uid;
  result.scout_sha256 = scout.sha256;
  result.scout_patient_position = scout.patient_position;
  result.picture = scene.picture(image, answer);
  result.picture_aspect = scout.row_step_patient_mm.norm() / scout.column_step_patient_mm.norm();
  return result;
}

}  // namespace isoshift
