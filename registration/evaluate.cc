#include "registration/evaluate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <random>

#include "base/error.h"
#include "geometry/rotation.h"
#include "geometry/target_error.h"

namespace isoshift {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

using Random = std::mt19937_64;

double uniform(double low, double high, Random& random) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

Vector3d random_direction(Random& random) {
  std::normal_distribution<double> gaussian;
  for (;;) {
    const Vector3d direction(gaussian(random), gaussian(random), gaussian(random));
    if (direction.norm() > 1e-6) return direction.normalized();
  }
}

// The pose with this rotation whose translation along `direction` brings the mTRE to what is wanted; nothing where the
// rotation alone exceeds that. From there on the mTRE grows, so that halving finds the length.
std::optional<Isometry3d> at_distance(const Isometry3d& truth, const Eigen::AngleAxisd& rotation,
                                      const Vector3d& direction, double wanted_mm,
                                      std::span<const Vector3d> targets_mm) {
  const auto pose = [&](double length_mm) {
    Isometry3d moved = rotation * truth;
    moved.translation() = truth.translation() + length_mm * direction;
    return moved;
  };
  const auto is_short = [&](double length_mm) {
    return mean_target_registration_error_mm(pose(length_mm), truth, targets_mm) < wanted_mm;
  };
  if (!is_short(0.0)) return std::nullopt;
  double low = 0.0, high = 1.0;
  while (is_short(high)) high *= 2.0;
  for (int halvings = 0; halvings < 60; ++halvings) {
    const double middle = 0.5 * (low + high);
    (is_short(middle) ? low : high) = middle;
  }
  return pose(low);
}

Isometry3d start_by_mtre(const Isometry3d& truth, const StartProtocol& protocol, int number,
                         std::span<const Vector3d> targets_mm, Random& random) {
  const int bins = std::max(1, static_cast<int>(std::floor(protocol.distance_mm)));
  const double width_mm = protocol.distance_mm / bins;
  for (;;) {
    const double wanted_mm = protocol.series == StartProtocol::Series::kMtre
                                 ? protocol.distance_mm
                                 : (number % bins + uniform(0.0, 1.0, random)) * width_mm;
    const Eigen::AngleAxisd rotation(uniform(-protocol.max_rotation_rad, protocol.max_rotation_rad, random),
                                     random_direction(random));
    if (const auto pose = at_distance(truth, rotation, random_direction(random), wanted_mm, targets_mm)) return *pose;
  }
}

Isometry3d start_of_paper(const Isometry3d& truth, const StartProtocol& protocol, Random& random) {
  const auto angle_rad = [&] { return uniform(-protocol.max_rotation_rad, protocol.max_rotation_rad, random); };
  const ZxyAngles angles{.z_rad = angle_rad(), .x_rad = angle_rad(), .y_rad = angle_rad()};
  Isometry3d pose;
  pose.linear() = rotation_from_zxy(angles) * truth.linear();
  pose.translation() = truth.translation() + protocol.distance_mm * random_direction(random);
  return pose;
}

bool is_success(const EvaluatedRun& run, bool by_mrpd) { return (by_mrpd ? run.mrpd_mm : run.mtre_mm) < kSuccessMm; }

double mean_of(std::span<const double> values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

double median_of(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::ranges::sort(values);
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

template <class Value>
std::vector<double> values_of(std::span<const EvaluatedRun> runs, Value EvaluatedRun::* field) {
  std::vector<double> values;
  for (const EvaluatedRun& run : runs) values.push_back(static_cast<double>(run.*field));
  return values;
}

OverAllRuns over_all(std::span<const EvaluatedRun> runs) {
  std::vector<EvaluatedRun> ended;
  std::ranges::copy_if(runs, std::back_inserter(ended), [](const EvaluatedRun& run) { return run.has_pose(); });
  const std::span<const EvaluatedRun> all = ended;
  std::vector<double> search_seconds;
  for (const EvaluatedRun& run : all) search_seconds.push_back(run.seconds_rendering + run.seconds_similarity);
  OverAllRuns over{.runs = static_cast<int>(ended.size()),
                   .mtre_mm = mean_and_sd_of(values_of(all, &EvaluatedRun::mtre_mm)),
                   .mpd_mm = mean_and_sd_of(values_of(all, &EvaluatedRun::mpd_mm)),
                   .mrpd_mm = mean_and_sd_of(values_of(all, &EvaluatedRun::mrpd_mm)),
                   .search_seconds = mean_and_sd_of(search_seconds),
                   .evaluations = mean_and_sd_of(values_of(all, &EvaluatedRun::evaluations))};
  if (over.search_seconds.mean > 0.0)
    over.rendering_share = mean_of(values_of(all, &EvaluatedRun::seconds_rendering)) / over.search_seconds.mean;
  return over;
}

std::optional<std::array<double, 6>> share_within(std::span<const EvaluatedRun> runs, double sigmas) {
  std::array<double, 6> share = {};
  double counted = 0.0;
  for (const EvaluatedRun& run : runs) {
    if (!run.sigma) continue;
    counted += 1.0;
    for (std::size_t axis = 0; axis < share.size(); ++axis)
      share[axis] += std::abs(run.error[axis]) <= sigmas * (*run.sigma)[axis] ? 1.0 : 0.0;
  }
  if (counted == 0.0) return std::nullopt;
  for (double& of_axis : share) of_axis /= counted;
  return share;
}

BodySummary summary_of(const std::string& name, std::span<const EvaluatedRun> runs) {
  BodySummary summary{.name = name};
  std::vector<double> errors_mm, lengths_mm, sigmas_off;
  for (const EvaluatedRun& run : runs)
    for (const EvaluatedBody& body : run.bodies) {
      if (body.name != name) continue;
      ++summary.runs;
      if (!body.is_determined) continue;
      ++summary.determined;
      const Vector3d error_mm = body.found_mm - body.true_mm;
      errors_mm.push_back(error_mm.norm());
      lengths_mm.push_back(body.true_mm.norm());
      for (int axis = 0; axis < 3; ++axis)
        if (body.sigma_mm[axis] > 0.0) sigmas_off.push_back(std::abs(error_mm[axis]) / body.sigma_mm[axis]);
    }
  const auto share_within = [&](double sigmas) {
    const auto within = std::ranges::count_if(sigmas_off, [&](double off) { return off <= sigmas; });
    return sigmas_off.empty() ? 0.0 : static_cast<double>(within) / static_cast<double>(sigmas_off.size());
  };
  summary.median_true_mm = median_of(lengths_mm);
  summary.median_error_mm = median_of(errors_mm);
  summary.within_one_sigma = share_within(1.0);
  summary.within_two_sigma = share_within(2.0);
  return summary;
}

std::vector<BodySummary> body_summaries(std::span<const EvaluatedRun> runs) {
  std::vector<BodySummary> summaries;
  for (const EvaluatedRun& run : runs)
    for (const EvaluatedBody& body : run.bodies)
      if (std::ranges::find(summaries, body.name, &BodySummary::name) == summaries.end())
        summaries.push_back(summary_of(body.name, runs));
  return summaries;
}

}  // namespace

std::string_view to_string(StartProtocol::Series series) {
  switch (series) {
    case StartProtocol::Series::kBins: return "bins";
    case StartProtocol::Series::kPaper: return "paper";
    case StartProtocol::Series::kMtre: return "mtre";
  }
  return "";
}

StartProtocol StartProtocol::paper() {
  return {.series = Series::kPaper, .distance_mm = 25.0, .max_rotation_rad = rad_from_deg(5.0), .count = 150};
}

void StartProtocol::check() const {
  if (!(distance_mm > 0.0 && distance_mm <= 200.0))
    throw UsageError(fmt::format("start distance of {} mm: expected more than 0, at most 200", distance_mm));
  if (!(max_rotation_rad >= 0.0 && max_rotation_rad <= rad_from_deg(90.0)))
    throw UsageError(fmt::format("start rotation of {} degrees: expected 0 to 90", deg_from_rad(max_rotation_rad)));
  if (count < 1) throw UsageError(fmt::format("{} starts: expected at least 1", count));
}

std::vector<StartPose> start_poses(const Isometry3d& truth, const StartProtocol& protocol) {
  protocol.check();
  const std::vector<Vector3d> targets_mm = standard_targets_mm();
  std::vector<StartPose> starts;
  for (int number = 0; number < protocol.count; ++number) {
    std::seed_seq seed = {static_cast<std::uint32_t>(protocol.seed), static_cast<std::uint32_t>(protocol.seed >> 32),
                          static_cast<std::uint32_t>(number)};
    Random random(seed);
    const Isometry3d pose = protocol.series == StartProtocol::Series::kPaper
                                ? start_of_paper(truth, protocol, random)
                                : start_by_mtre(truth, protocol, number, targets_mm, random);
    starts.push_back({.setup_error = pose, .mtre_mm = mean_target_registration_error_mm(pose, truth, targets_mm)});
  }
  return starts;
}

std::vector<SuccessBin> success_bins(std::span<const EvaluatedRun> runs, bool by_mrpd) {
  std::map<int, SuccessBin> bins;
  for (const EvaluatedRun& run : runs) {
    const int start_mm = static_cast<int>(run.start_mtre_mm);
    SuccessBin& bin = bins.try_emplace(start_mm, SuccessBin{.start_mm = start_mm}).first->second;
    ++bin.runs;
    bin.successes += is_success(run, by_mrpd) ? 1 : 0;
  }
  std::vector<SuccessBin> list;
  list.reserve(bins.size());
  for (const auto& [start_mm, bin] : bins) list.push_back(bin);
  return list;
}

EvaluationSummary summarized(std::span<const EvaluatedRun> runs, bool by_mrpd) {
  EvaluationSummary summary;
  std::vector<EvaluatedRun> found;
  std::vector<double> failed_rotation_share;
  for (const EvaluatedRun& run : runs) {
    if (is_success(run, by_mrpd))
      found.push_back(run);
    else
      failed_rotation_share.push_back(run.rotation_share);
    const bool accepted = run.verdict == Verdict::kAccepted;
    if (run.mtre_mm < 1.0) {
      ++summary.within_1_mm;
      summary.within_1_mm_accepted += accepted ? 1 : 0;
    } else if (run.mtre_mm > 2.0) {
      ++summary.beyond_2_mm;
      summary.beyond_2_mm_accepted += accepted ? 1 : 0;
    }
    summary.target_within_1_mm += run.target_mm < 1.0 ? 1 : 0;
    summary.target_within_1_mm_accepted += run.target_mm < 1.0 && accepted ? 1 : 0;
    summary.target_beyond_2_mm_accepted += run.target_mm > 2.0 && accepted ? 1 : 0;
  }
  summary.runs = static_cast<int>(runs.size());
  summary.successes = static_cast<int>(found.size());
  const std::vector<double> mtre_mm = values_of(std::span<const EvaluatedRun>(found), &EvaluatedRun::mtre_mm);
  const MeanAndSd of_successes = mean_and_sd_of(mtre_mm);
  summary.mean_mm = of_successes.mean;
  summary.sd_mm = of_successes.sd;
  summary.median_mm = median_of(mtre_mm);
  summary.mean_mpd_mm = mean_of(values_of(std::span<const EvaluatedRun>(found), &EvaluatedRun::mpd_mm));
  summary.mean_mrpd_mm = mean_of(values_of(std::span<const EvaluatedRun>(found), &EvaluatedRun::mrpd_mm));
  for (const SuccessBin& bin : success_bins(runs, by_mrpd)) {
    if (bin.start_mm != summary.capture_range_mm) break;
    summary.may_capture_more = bin.successes >= 0.95 * bin.runs;
    if (!summary.may_capture_more) break;
    summary.capture_range_mm = bin.start_mm + 1;
  }
  summary.rotation_share_of_failures = mean_of(failed_rotation_share);
  summary.median_target_mm = median_of(values_of(runs, &EvaluatedRun::target_mm));
  summary.median_seconds = median_of(values_of(runs, &EvaluatedRun::seconds));
  summary.mean_evaluations = mean_of(values_of(runs, &EvaluatedRun::evaluations));
  if (const double seconds = mean_of(values_of(runs, &EvaluatedRun::seconds)); seconds > 0.0) {
    summary.rendering_share = mean_of(values_of(runs, &EvaluatedRun::seconds_rendering)) / seconds;
    summary.similarity_share = mean_of(values_of(runs, &EvaluatedRun::seconds_similarity)) / seconds;
  }
  summary.within_one_sigma = share_within(runs, 1.0);
  summary.within_two_sigma = share_within(runs, 2.0);
  summary.bodies = body_summaries(runs);
  summary.all = over_all(runs);
  return summary;
}

}  // namespace isoshift
