#include "registration/bodies/target_search.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <numeric>

#include "registration/pose_parameters.h"

namespace isoshift {
namespace {

// Of the logarithm of probability, which is too sure: neighboring tiles are not independent. Searches that ended at
// another vertebra, or between two, were 20 and more behind after the first stage and hundreds after the second.
constexpr double kClearlyLess = 15.0;
constexpr double kSamePlaceMm = 1.0;

// A place to begin at, and what became of it.
struct Hypothesis {
  std::string description;
  BodySearchResult found;
};

// The vertebra nearest to the target; the number of bodies where the CT shows none.
std::size_t vertebra_at_target(const JointedBodies& bodies) {
  const auto nearest = std::ranges::find_if(
      bodies.bodies, [](const JointedBodies::Body& body) { return body.is_vertebra && body.vertebra == 0; });
  return static_cast<std::size_t>(nearest - bodies.bodies.begin());
}

std::vector<Hypothesis> hypotheses_of(const BodyScene& scene) {
  const Eigen::Isometry3d& whole = scene.whole_room_from_patient;
  std::vector<Hypothesis> hypotheses = {{.description = "the spine where the patient as a whole matches best",
                                         .found = {.poses = at_one_pose(scene, whole)}}};
  const std::size_t at_target = vertebra_at_target(scene.bodies);
  if (at_target == scene.bodies.bodies.size()) return hypotheses;
  for (const int step : {-1, 1}) {
    const std::size_t other = at_target + static_cast<std::size_t>(step);
    if (other >= scene.bodies.bodies.size() || !scene.bodies.bodies[other].is_vertebra) continue;
    const Eigen::Vector3d way =
        scene.fine.apart.center_patient_mm(other) - scene.fine.apart.center_patient_mm(at_target);
    for (const double part : {0.5, 1.0})
      hypotheses.push_back({.description = fmt::format("the spine {} vertebra farther toward the {}",
                                                       part < 1.0 ? "half a" : "one", step > 0 ? "head" : "feet"),
                            .found = {.poses = at_one_pose(scene, whole * Eigen::Translation3d(part * way))}});
  }
  return hypotheses;
}

// Gradient correlation, mean over the views.
double match_of(const BodyScene& scene, const BodyPoses& poses, const BodyStage& stage) {
  const std::vector<double> matches =
      scene.of(stage).matches(scene.views.reduced_to(stage.pixel_mm, scene.whole_room_from_patient, 5.0), poses);
  return std::reduce(matches.begin(), matches.end()) / static_cast<double>(matches.size());
}

PoseDistance distance_of(const Carriers& carriers, const Hypothesis& a, const Hypothesis& b) {
  return distance_between(parameters_from_setup_error(carriers.setup_error_at(a.found.poses)),
                          parameters_from_setup_error(carriers.setup_error_at(b.found.poses)));
}

bool is_clearly_less(const Hypothesis& one, const Hypothesis& best) {
  return one.found.log_probability < best.found.log_probability - kClearlyLess;
}

// From where the last stage ended.
void search_on(const BodyScene& scene, const BodyStage& stage, double bound_mm, Hypothesis& one) {
  BodySearchResult found = search_bodies(scene, one.found.poses, std::span(&stage, 1), bound_mm);
  one.found.poses = std::move(found.poses);
  one.found.log_probability = found.log_probability;
  one.found.stages.push_back(std::move(found.stages.front()));
}

Alternative alternative_of(const BodyScene& scene, const Carriers& carriers, const BodyStage& stage,
                           const Hypothesis& other, const Hypothesis& best) {
  const PoseDistance distance = distance_of(carriers, other, best);
  return {.description = other.description,
          .similarity = match_of(scene, other.found.poses, stage),
          .as_is = match_of(scene, best.found.poses, stage),
          .distance_mm = distance.translation_mm,
          .angle_rad = distance.angle_rad,
          .is_ruled_out = is_clearly_less(other, best)};
}

}  // namespace

TargetSearchResult search_target(const BodyScene& scene, const Carriers& carriers, const BodySearchOptions& options,
                                 const SearchProgress& progress) {
  TargetSearchResult result;
  std::vector<Hypothesis> open = hypotheses_of(scene);
  double done = 0.0;
  for (const BodyStage& stage : options.stages) {
    for (Hypothesis& one : open) {
      search_on(scene, stage, options.bound_mm, one);
      done += 1.0 / static_cast<double>(options.stages.size() * open.size());
      if (progress) progress(std::min(done, 1.0));
    }
    std::ranges::sort(open, std::greater(), [](const Hypothesis& one) { return one.found.log_probability; });
    const bool is_last = &stage == &options.stages.back();
    std::vector<Hypothesis> kept = {open.front()};
    for (const Hypothesis& one : std::span(open).subspan(1)) {
      const bool has_come_to_a_better = std::ranges::any_of(kept, [&](const Hypothesis& better) {
        return distance_of(carriers, one, better).translation_mm < kSamePlaceMm;
      });
      if (has_come_to_a_better) continue;
      if (is_last || is_clearly_less(one, open.front()))
        result.alternatives.push_back(alternative_of(scene, carriers, stage, one, open.front()));
      else
        kept.push_back(one);
    }
    open = std::move(kept);
  }
  result.poses = open.front().found.poses;
  result.stages = open.front().found.stages;
  return result;
}

}  // namespace isoshift
