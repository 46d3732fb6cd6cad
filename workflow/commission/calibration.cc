#include "workflow/commission/calibration.h"

#include <algorithm>
#include <cmath>

#include "geometry/motion_axes.h"

namespace isoshift {
namespace {

using Group = std::vector<const Placed*>;

// Whether what imagers may put off is alike in both sessions; it is if nothing is known of imagers.
bool have_alike_imagers(const Placed& one, const Placed& other) {
  const bool are_known = !one.imager_covariance.isZero() || !other.imager_covariance.isZero();
  return !are_known || (have_same_views(one, other) && have_same_couch_angle(one, other));
}

// Sessions that can be compared with each other: which determine the same axes, with alike imagers.
std::vector<Group> groups_of(const std::vector<Placed>& sessions) {
  std::vector<Group> groups;
  for (const Placed& session : sessions) {
    const auto group = std::ranges::find_if(groups, [&](const Group& alike) {
      return alike.front()->are_determined == session.are_determined && have_alike_imagers(*alike.front(), session);
    });
    if (group == groups.end())
      groups.push_back({&session});
    else
      group->push_back(&session);
  }
  return groups;
}

// Every session against the mean of all before it (Helmert's contrasts), which are independent of each other where the
// sessions' uncertainties are equal, and of what all sessions share.
std::vector<Localized> contrasts_of(const Group& sessions) {
  std::vector<Localized> contrasts;
  for (std::size_t now = 1; now < sessions.size(); ++now) {
    const auto before = static_cast<double>(now);
    Compared contrast = compared(*sessions[now]);
    contrast.error.setZero();
    CarriedErrors errors;
    errors.add(*sessions[now], at_known_point(*sessions[now]));
    for (std::size_t n = 0; n < now; ++n) {
      const Compared move = compared(*sessions[n], *sessions[now]);
      contrast.error += move.error / before;
      const Eigen::Isometry3d motion = sessions[now]->found * sessions[n]->found.inverse();
      errors.add(*sessions[n], -at_known_point(*sessions[now]) * carried_by(motion) / before);
      for (std::size_t axis = 0; axis < 6; ++axis)
        contrast.are_determined[axis] = contrast.are_determined[axis] && move.are_determined[axis];
    }
    contrast.covariance = errors.covariance();
    contrasts.push_back(localized(sessions[now]->name, contrast));
  }
  return contrasts;
}

Localized mean_of(const Group& sessions) {
  const auto count = static_cast<double>(sessions.size());
  Compared mean = compared(*sessions.front());
  mean.error.setZero();
  CarriedErrors errors;
  for (const Placed* session : sessions) {
    mean.error += compared(*session).error / count;
    errors.add(*session, at_known_point(*session) / count);
  }
  mean.covariance = errors.covariance();
  return localized(sessions.front()->name, mean);
}

class Counts {
 public:
  void add(const Localized& one, std::size_t axis) {
    if (!one.error[axis] || !one.sigma[axis]) return;
    const double sigmas = std::abs(*one.error[axis]) / *one.sigma[axis];
    ++total_;
    within_one_ += sigmas <= 1.0 ? 1U : 0U;
    within_two_ += sigmas <= 2.0 ? 1U : 0U;
  }
  void add_shared(const Localized& mean, std::size_t axis) {
    if (!mean.error[axis] || !mean.sigma[axis]) return;
    ++shared_;
    most_shared_ = std::max(most_shared_, std::abs(*mean.error[axis]) / *mean.sigma[axis]);
  }

  Calibration calibration() const {
    constexpr double kOneSigma = 0.6827, kTwoSigma = 0.9545;
    Calibration calibration;
    bool holds = true;
    if (total_ > 0) {
      calibration.within_one_sigma = share_of(within_one_, total_);
      calibration.within_two_sigma = share_of(within_two_, total_);
      holds = calibration.within_one_sigma->high >= kOneSigma && calibration.within_two_sigma->high >= kTwoSigma;
    }
    if (shared_ > 0) {
      calibration.shared_sigmas = most_shared_;
      calibration.shared_sigmas_limit = sigmas_hardly_exceeded(shared_);
      holds = holds && most_shared_ <= *calibration.shared_sigmas_limit;
    }
    if (!holds)
      calibration.outcome = Outcome::kFailed;
    else if (total_ > 0)
      calibration.outcome = Outcome::kPassed;
    return calibration;
  }

 private:
  std::size_t total_ = 0, within_one_ = 0, within_two_ = 0, shared_ = 0;
  double most_shared_ = 0.0;
};

}  // namespace

Calibration calibration_of(const std::vector<Placed>& sessions, Known known) {
  Counts counts;
  for (const Group& group : groups_of(sessions)) {
    const std::vector<Localized> contrasts = contrasts_of(group);
    const Localized mean = mean_of(group);
    for (std::size_t axis = 0; axis < 6; ++axis) {
      const auto n = static_cast<Eigen::Index>(axis);
      const bool may_be_put_off = group.front()->imager_covariance(n, n) > 0.0;
      if (known == Known::kPositions && !may_be_put_off) {
        for (const Placed* session : group) counts.add(localized(session->name, compared(*session)), axis);
        continue;
      }
      for (const Localized& contrast : contrasts) counts.add(contrast, axis);
      if (known == Known::kPositions) counts.add_shared(mean, axis);
    }
  }
  return counts.calibration();
}

}  // namespace isoshift
