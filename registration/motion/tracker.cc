#include "registration/motion/tracker.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/median.h"
#include "registration/pose_parameters.h"
#include "registration/quality/findings.h"
#include "setup/couch_shift.h"

namespace isoshift {
namespace {

constexpr double kUnseenVarianceMm2 = 1e6;
constexpr std::size_t kUsual = 25;  // so many good similarities say what is usual
constexpr int kLostMoments = 5;     // in a row: the target is looked for anew
constexpr double kFilterAcceleration = 400.0;
constexpr double kLeastSimilarity = 0.2;  // of gradient correlation: what chance reaches is a tenth of that
constexpr double kLongestCoastS = 1.0;    // after the last measurement the filter's speed counts no longer than this

}  // namespace

std::string_view to_string(FrameStatus status) {
  switch (status) {
    case FrameStatus::kMeasured: return "measured";
    case FrameStatus::kPartly: return "partly";
    case FrameStatus::kBridged: return "bridged";
  }
  return "";
}

Tracker::Tracker(const RendererPyramid& renderers, const ProjectedRegion& region,
                 const Eigen::Isometry3d& planned_room_from_patient, const Eigen::Vector3d& target_patient_mm,
                 TrackingOptions options)
    : renderers_(renderers),
      region_(region),
      planned_(planned_room_from_patient),
      target_patient_mm_(target_patient_mm),
      options_(std::move(options)),
      filter_({.acceleration_noise = kFilterAcceleration}) {
  PredictorOptions of_predictor = options_.predictor_options;
  of_predictor.latency_s = options_.latency_s;
  predictor_ = make_predictor(options_.predictor, of_predictor);
}

std::optional<Tracker::Found> Tracker::find(const FixedViews& views, const Eigen::Vector3d& expected_mm,
                                            const std::vector<Eigen::Vector3d>& unseen) const {
  const bool is_first = similarities_.empty() || lost_in_a_row_ >= kLostMoments;
  const Stage fine{.name = "track",
                   .similarity = SimilarityKind::kGradientCorrelation,
                   .pixel_mm = options_.pixel_mm,
                   .initial_step_mm = 1.5,
                   .initial_step_rad = 0.01,
                   .relative_tolerance = 0.02,
                   .max_evaluations = 80};
  Stage wide = fine;
  wide.name = "look for it";
  wide.pixel_mm = 2.0 * options_.pixel_mm;
  wide.candidates = 400;
  wide.starts = 4;
  wide.reach_mm = options_.first_reach_mm;
  wide.initial_step_mm = 4.0;
  std::vector<Stage> stages;
  if (is_first) stages.push_back(wide);
  stages.push_back(fine);
  const double bound_mm = is_first ? options_.first_reach_mm + options_.box_mm : options_.box_mm;
  const Eigen::Vector3d target_mm = planned_ * target_patient_mm_;
  const Eigen::Isometry3d start = Eigen::Translation3d(target_mm + expected_mm) *
                                  Eigen::Isometry3d(Eigen::Quaterniond(rotation_)) * Eigen::Translation3d(-target_mm) *
                                  planned_;
  const auto result = search_if_possible(renderers_, views, start,
                                         {.stages = stages,
                                          .dof = options_.dof,
                                          .bound_mm = bound_mm,
                                          .bound_rad = options_.box_rad,
                                          .seed = options_.seed});
  if (!result) return std::nullopt;
  Found found{.pose = setup_error_from_parameters(result->parameters) * start,
              .similarity = result->stages.back().value};
  // Along an unseen direction the search may end anywhere.
  constexpr double kAtBound = 0.98;
  Eigen::Vector3d moved_mm(result->parameters.data());
  for (const Eigen::Vector3d& direction : unseen) moved_mm -= direction.dot(moved_mm) * direction;
  found.at_bound = moved_mm.cwiseAbs().maxCoeff() > kAtBound * bound_mm;
  for (std::size_t n = 3; n < result->parameters.size(); ++n)
    found.at_bound = found.at_bound || std::abs(result->parameters[n]) > kAtBound * options_.box_rad * kLeverMm;
  return found;
}

bool Tracker::is_lost(const Found& found, const std::vector<Eigen::Vector3d>& unseen) const {
  Eigen::Vector3d from_plan_mm = found.pose * target_patient_mm_ - planned_ * target_patient_mm_;
  for (const Eigen::Vector3d& direction : unseen) from_plan_mm -= direction.dot(from_plan_mm) * direction;
  const double least = similarities_.empty() ? kLeastSimilarity
                                             : std::max(kLeastSimilarity, options_.lost_share * median(similarities_));
  return found.at_bound || found.similarity < least || from_plan_mm.norm() > options_.first_reach_mm + options_.box_mm;
}

TrackedFrame Tracker::track(double time_s, std::vector<FixedImage> views) {
  if (last_time_s_ && time_s <= *last_time_s_)
    throw UsageError(fmt::format("an X-ray of {} s after one of {} s", time_s, *last_time_s_));
  last_time_s_ = time_s;
  std::vector<XrayView> cameras;
  cameras.reserve(views.size());
  for (const FixedImage& view : views) cameras.push_back(view.view);
  const std::vector<Eigen::Vector3d> unseen =
      cameras.empty() ? std::vector<Eigen::Vector3d>() : unobservable_directions(cameras);
  Eigen::Vector3d expected_mm = Eigen::Vector3d::Zero();
  if (lost_in_a_row_ >= kLostMoments)
    rotation_.setIdentity();  // looked for anew, about the plan
  else if (last_measured_s_)
    expected_mm = filter_.predict(std::min(time_s, *last_measured_s_ + kLongestCoastS)).position_mm;

  TrackedFrame frame{.time_s = time_s, .unseen_room = unseen};
  std::optional<Found> found;
  if (!views.empty()) found = find({.images = std::move(views), .region = region_}, expected_mm, unseen);
  if (found && !is_lost(*found, unseen)) {
    frame.similarity = found->similarity;
    frame.status = unseen.empty() ? FrameStatus::kMeasured : FrameStatus::kPartly;
    Eigen::Vector3d measured_mm = found->pose * target_patient_mm_ - planned_ * target_patient_mm_;
    Eigen::Matrix3d covariance =
        options_.measurement_sigma_mm * options_.measurement_sigma_mm * Eigen::Matrix3d::Identity();
    for (const Eigen::Vector3d& direction : unseen) {
      measured_mm += direction.dot(expected_mm - measured_mm) * direction;
      covariance += kUnseenVarianceMm2 * direction * direction.transpose();
    }
    filter_.add(time_s, measured_mm, covariance);
    const Prediction now = filter_.predict(time_s);
    for (const Eigen::Vector3d& direction : unseen)
      measured_mm += direction.dot(now.position_mm - measured_mm) * direction;
    frame.measured_mm = measured_mm;
    predictor_->add(time_s, unseen.empty() ? Eigen::VectorXd(measured_mm) : now.position_mm, covariance);
    if (options_.dof == Dof::kRigid) rotation_ = (found->pose * planned_.inverse()).linear();
    last_measured_s_ = time_s;
    similarities_.push_back(found->similarity);
    if (similarities_.size() > kUsual) similarities_.erase(similarities_.begin());
    lost_in_a_row_ = 0;
  } else {
    if (found) frame.similarity = found->similarity;
    ++lost_in_a_row_;
  }
  frame.is_lost = lost_in_a_row_ >= kLostMoments;
  if (!last_measured_s_) return frame;
  frame.is_known = true;
  const double coast_until_s = *last_measured_s_ + kLongestCoastS;
  frame.filtered_mm = filter_.predict(std::min(time_s, coast_until_s)).position_mm;
  frame.sigma_mm = filter_.predict(time_s).sigma_mm.value();
  frame.is_warm = predictor_->is_warm();
  frame.predicted_mm = predictor_->predict(std::min(time_s + options_.latency_s, coast_until_s)).position_mm;
  return frame;
}

}  // namespace isoshift
