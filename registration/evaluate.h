#pragma once
// How good a registration is, by the protocol of van de Kraats et al. (IEEE TMI 24, 2005): starts at known distances
// from the truth, errors at target points, success, capture range (docs/evaluation.md).

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/mean_and_sd.h"
#include "geometry/xray_view.h"
#include "setup/verdict.h"

namespace isoshift {

// Where the searches begin.
struct StartProtocol {
  enum class Series {
    kBins,   // start mTRE spread evenly over bins of 1 mm: rotation axis uniform, angle uniform within the limit,
             // translation direction uniform and as long as the bin needs; drawn again where the rotation alone exceeds
             // it
    kPaper,  // translations of one length, three rotations uniform within the limit
    kMtre,   // as kBins, but every start has the same mTRE
  };

  Series series = Series::kBins;
  double distance_mm = 20.0;  // kBins: the largest start mTRE; kPaper: the length of the translation; kMtre: the mTRE
  double max_rotation_rad = 0.1745329251994330;
  int count = 200;
  std::uint64_t seed = 1;

  // 150 starts 25 mm away, as in the founding paper, turned by up to 5 degrees, which the paper does not say.
  static StartProtocol paper();

  // Throws UsageError naming the field and its value.
  void check() const;
};
std::string_view to_string(StartProtocol::Series series);

struct StartPose {
  Eigen::Isometry3d setup_error = Eigen::Isometry3d::Identity();
  double mtre_mm = 0.0;
};

// The same seed gives the same starts. Every start is drawn from a generator of its own, so that the first 50 of 200
// starts are the same as 50 starts.
std::vector<StartPose> start_poses(const Eigen::Isometry3d& truth, const StartProtocol& protocol);

// What a bone did against the target once that is right, in mm in the room: found, and true at the bone's center.
struct EvaluatedBody {
  std::string name;
  bool is_determined = false;
  Eigen::Vector3d found_mm = Eigen::Vector3d::Zero(), true_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d sigma_mm = Eigen::Vector3d::Zero();  // as the registration gave it
};

// One registration of an evaluation. Errors are found * truth^-1: translation at the isocenter and rotation vector.
struct EvaluatedRun {
  int number = 0;
  double start_mtre_mm = 0.0;
  double mtre_mm = 0.0;
  double mpd_mm = 0.0, mrpd_mm = 0.0;  // means over the views
  double target_mm = 0.0;              // of the target: the farthest corner of a box of 15 mm edge about its center
  double rotation_share = 0.0;
  std::array<double, 6> error = {};            // x, y, z in mm, about x, y, z in degrees
  std::optional<std::array<double, 6>> sigma;  // what the registration gave as its uncertainty, the same units
  Verdict verdict = Verdict::kRejected;
  std::string reasons;  // why it is not accepted
  int evaluations = 0;
  double seconds = 0.0, seconds_rendering = 0.0, seconds_similarity = 0.0;
  std::vector<EvaluatedBody> bodies;  // where bodies answered, those whose truth is known

  bool has_pose() const { return std::isfinite(mtre_mm); }  // false: the registration ended with an error
};

// A registration counts as successful below this mTRE (mRPD where one view cannot tell depth).
inline constexpr double kSuccessMm = 2.0;

// All that was found of the bone of one name, where it was determined.
struct BodySummary {
  std::string name;
  int runs = 0, determined = 0;
  double median_true_mm = 0.0, median_error_mm = 0.0;     // lengths
  double within_one_sigma = 0.0, within_two_sigma = 0.0;  // shares of axes that have a sigma
};

// Of all runs that ended with a pose, failures among them.
struct OverAllRuns {
  int runs = 0;
  MeanAndSd mtre_mm, mpd_mm, mrpd_mm;
  MeanAndSd search_seconds;  // rendering and similarity of the search, without what a registration does beside it
  MeanAndSd evaluations;
  double rendering_share = 0.0;  // of the time of an iteration of the search: rendering and similarity
};

struct EvaluationSummary {
  int runs = 0, successes = 0;
  double mean_mm = 0.0, sd_mm = 0.0, median_mm = 0.0;  // mTRE of the successes
  double mean_mpd_mm = 0.0, mean_mrpd_mm = 0.0;        // of the successes
  // The last bin of 1 mm of start mTRE before success falls below 95 %: its upper end.
  int capture_range_mm = 0;
  bool may_capture_more = true;             // no start from the next mm was tried
  double rotation_share_of_failures = 0.0;  // mean
  double median_seconds = 0.0, mean_evaluations = 0.0;
  double rendering_share = 0.0, similarity_share = 0.0;  // of all time
  int within_1_mm = 0, within_1_mm_accepted = 0;         // runs that ended there, and how many of them were accepted
  int beyond_2_mm = 0, beyond_2_mm_accepted = 0;
  // The same of the target alone, and the median over all runs.
  double median_target_mm = 0.0;
  int target_within_1_mm = 0, target_within_1_mm_accepted = 0;
  int target_beyond_2_mm_accepted = 0;
  // Share of runs whose true error lies within one and two sigma, per axis; nothing without sigmas.
  std::optional<std::array<double, 6>> within_one_sigma, within_two_sigma;
  std::vector<BodySummary> bodies;  // in the order of their first mention
  OverAllRuns all;

  double success_share() const { return runs > 0 ? static_cast<double>(successes) / runs : 0.0; }
};
// `by_mrpd`: success is judged by mRPD, for a single view.
EvaluationSummary summarized(std::span<const EvaluatedRun> runs, bool by_mrpd);

// Success per bin of 1 mm of start mTRE, of the bins that have runs.
struct SuccessBin {
  int start_mm = 0;  // its lower end
  int runs = 0, successes = 0;
};
std::vector<SuccessBin> success_bins(std::span<const EvaluatedRun> runs, bool by_mrpd);

}  // namespace isoshift
