#include "registration/quality.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "geometry/rotation.h"

namespace isoshift {
namespace {

constexpr double kMinViewSeparationRad = rad_from_deg(30.0);
constexpr double kAtBoundShare = 0.99;
// The search ends on gradient correlation, whose top lies beside that of the NCC by what scatter and noise do to it: a
// patient exactly on plan may lose a little. On phantoms and real data less than 0.001 was lost.
constexpr double kNccNoise = 0.005;

}  // namespace

std::vector<Eigen::Vector3d> unobservable_directions(std::span<const XrayView> views) {
  // Opposed views see the same two axes: directions count without their sign.
  double largest_separation_rad = 0.0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const XrayView& view : views) {
    const Eigen::Vector3d direction = view.central_direction_room();
    for (const XrayView& other : views)
      largest_separation_rad = std::max(
          largest_separation_rad, std::acos(std::min(1.0, std::abs(direction.dot(other.central_direction_room())))));
    sum += direction.dot(views.front().central_direction_room()) < 0.0 ? Eigen::Vector3d(-direction) : direction;
  }
  if (largest_separation_rad >= kMinViewSeparationRad) return {};
  return {sum.normalized()};
}

void judge(std::span<const double> parameters, const RegistrationOptions& options, RegistrationResult& result) {
  static constexpr std::array kNames = {"x translation",    "y translation",    "z translation",
                                        "rotation about x", "rotation about y", "rotation about z"};
  result.reasons.clear();
  result.verdict = Verdict::kAccepted;
  const auto demote = [&](Verdict to, std::string reason) {
    if (to > result.verdict) result.verdict = to;
    result.reasons.push_back(std::move(reason));
  };

  for (std::size_t n = 0; n < parameters.size(); ++n) {
    const double bound = n < 3 ? options.bound_mm : options.bound_rad;
    if (std::abs(parameters[n]) >= kAtBoundShare * bound)
      demote(Verdict::kReview, fmt::format("the {} ended at its bound", kNames[n]));
  }
  double mean = 0.0;
  for (std::size_t n = 0; n < result.views.size(); ++n) {
    const ViewReport& view = result.views[n];
    mean += view.similarity_final / static_cast<double>(result.views.size());
    if (!(view.similarity_final >= view.similarity_start - kNccNoise))
      demote(Verdict::kReview,
             fmt::format("view {} matches worse than at the planned pose (similarity {:.4f}, was {:.4f})", n + 1,
                         view.similarity_final, view.similarity_start));
  }
  if (!(mean >= options.min_ncc))
    demote(Verdict::kReview,
           fmt::format("the final normalized cross correlation {:.3f} is below {:.2f}", mean, options.min_ncc));
  if (result.stages.empty() || result.stages.back().reached_limit)
    demote(Verdict::kReview, "the last stage of the search did not converge");
  // On the phantom of the demo, where ray casters end 0.1 mm beside the truth, splatting ended 1.4 mm beside it: its
  // noise belongs to the voxels, moves with them, and carries its own gradients into the last stage.
  if (is_splatting(result.renderer))
    demote(Verdict::kReview,
           fmt::format("the DRRs of {} are too noisy for the last stage of the search", to_string(result.renderer)));
  if (!result.unobservable_room.empty())
    demote(Verdict::kReview, "all views look along nearly the same direction, along which nothing was measured");
  if (result.verdict == Verdict::kAccepted)
    result.warnings.push_back(
        "the quality checks of this version are not complete: look at the pictures before you act");
}

}  // namespace isoshift
