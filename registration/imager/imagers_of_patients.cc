#include "registration/imager/imagers_of_patients.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "base/error.h"
#include "geometry/linear_algebra.h"
#include "registration/imager/imager_effect.h"

namespace isoshift {
namespace {

using Motion = Eigen::Matrix<double, 6, 1>;

// What the sigmas of wanted motions leave out: voxels of finite size and the model of the beam.
constexpr double kFloorMm = 0.03, kFloorRad = 0.03 / 100.0;
constexpr double kFreedom = 4.0;  // of the t-distribution

// The motions that look like a unit of each error in a view.
Eigen::Matrix<double, 6, kImagerParameters> motions_like_errors(const ImagerModel& model) {
  const SeenBy seen = seen_by(model);
  return least_squares(seen.motions, seen.errors);
}

// What a session tells of the errors, its own pose eliminated: errors' information * errors = seen.
struct Told {
  Eigen::MatrixXd information;
  Eigen::VectorXd seen;
  double squares = 0.0;  // of what is wanted, without any errors, in sigmas
  double freedom = 0.0;  // how many numbers that are

  double misfit(const Eigen::VectorXd& errors) const {
    return squares - 2.0 * errors.dot(seen) + pulled_back(errors, information).value();
  }
};

Told told_by(const PatientSession& session, std::size_t imagers) {
  const auto parameters = static_cast<Eigen::Index>(imagers * kImagerParameters);
  Told told{.information = Eigen::MatrixXd::Zero(parameters, parameters), .seen = Eigen::VectorXd::Zero(parameters)};
  Eigen::MatrixXd of_pose = Eigen::MatrixXd::Zero(6, 6);
  Eigen::MatrixXd pose_by_errors = Eigen::MatrixXd::Zero(6, parameters);
  Motion pose_seen = Motion::Zero();
  for (const PatientView& view : session.views) {
    Eigen::MatrixXd covariance = view.wanted.covariance;
    covariance.diagonal().head<3>().array() += kFloorMm * kFloorMm;
    covariance.diagonal().tail<3>().array() += kFloorRad * kFloorRad;
    const Eigen::MatrixXd weight = inverse(covariance);
    Eigen::MatrixXd like = Eigen::MatrixXd::Zero(6, parameters);
    like.middleCols<kImagerParameters>(static_cast<Eigen::Index>(view.imager * kImagerParameters)) =
        motions_like_errors(view.model);
    told.information += pulled_back(like, weight);
    told.seen += transposed_product(like, product(weight, view.wanted.motion));
    told.squares += pulled_back(view.wanted.motion, weight).value();
    of_pose += weight;
    pose_by_errors += product(weight, like);
    pose_seen += product(weight, view.wanted.motion);
    told.freedom += 6.0;
  }
  const Eigen::MatrixXd pose_alone = solve_symmetric(of_pose, pose_seen);
  told.information -= transposed_product(pose_by_errors, solve_symmetric(of_pose, pose_by_errors));
  told.seen -= transposed_product(pose_by_errors, pose_alone);
  told.squares -= transposed_product(pose_seen, pose_alone).value();
  told.freedom -= 6.0;
  return told;
}

// Errors that differ from a motion of the patient by perspective alone, a tenth of a degree per mm or less, or that act
// like the scale of a CT, whose bones may look larger by partial volume. Many sessions bring their sigmas down to that,
// but not what is wrong with registrations of patients.
bool only_balls_tell(ImagerParameter parameter) {
  using enum ImagerParameter;
  return parameter == kShiftY || parameter == kDistance || parameter == kTiltX || parameter == kTiltY;
}

struct Fit {
  Eigen::VectorXd errors;
  Eigen::MatrixXd covariance;
  double misfit = 0.0;
};

Fit fitted(std::span<const Told> sessions, std::size_t imagers) {
  Eigen::VectorXd expected(static_cast<Eigen::Index>(imagers * kImagerParameters));
  for (Eigen::Index n = 0; n < expected.size(); ++n)
    expected[n] = imager_parameters()[static_cast<std::size_t>(n) % kImagerParameters].expected;
  const Eigen::MatrixXd prior = expected.cwiseAbs2().cwiseInverse().asDiagonal();
  Fit fit{.errors = Eigen::VectorXd::Zero(expected.size()), .covariance = {}, .misfit = 1.0};
  constexpr int kRounds = 30;
  for (int round = 0; round < kRounds; ++round) {
    Eigen::MatrixXd information = Eigen::MatrixXd::Zero(expected.size(), expected.size());
    Eigen::VectorXd seen = Eigen::VectorXd::Zero(expected.size());
    double squares = 0.0, freedom = 0.0;
    for (const Told& told : sessions) {
      const double misfit = told.misfit(fit.errors);
      // At first no session is known to be odd: what all of them show may be the imager.
      const double weight =
          round == 0 ? 1.0 : (kFreedom + told.freedom) / (kFreedom + misfit / (fit.misfit * fit.misfit));
      information += weight * told.information;
      seen += weight * told.seen;
      squares += weight * misfit;
      freedom += told.freedom;
    }
    fit.misfit = std::sqrt(squares / freedom);
    const double scale = 1.0 / std::max(1.0, fit.misfit * fit.misfit);
    fit.covariance = inverse(scale * information + prior);
    fit.errors = product(fit.covariance, scale * seen);
  }
  return fit;
}

// The CTs that an imager saw the patients of, with the numbers of their sessions.
using SessionsByCt = std::map<std::string, std::vector<std::size_t>>;

SessionsByCt cts_seen_by(std::size_t imager, std::span<const PatientSession> sessions) {
  SessionsByCt cts;
  for (std::size_t n = 0; n < sessions.size(); ++n)
    if (std::ranges::find(sessions[n].views, imager, &PatientView::imager) != sessions[n].views.end())
      cts[sessions[n].ct].push_back(n);
  return cts;
}

// What leaving out each CT tells of an imager's errors.
struct Jackknife {
  std::array<double, kImagerParameters> sigmas{};          // by how much the errors then differ
  std::array<double, kImagerParameters> largest_sigmas{};  // those of the least squares, where the worst is left out
};

// Precondition: there are two CTs or more.
Jackknife jackknifed(std::size_t imager, const SessionsByCt& cts, std::span<const Told> told, std::size_t imagers) {
  constexpr auto kCount = static_cast<Eigen::Index>(kImagerParameters);
  const auto first = static_cast<Eigen::Index>(imager) * kCount;
  Eigen::MatrixXd without(kCount, static_cast<Eigen::Index>(cts.size()));
  Jackknife jackknife;
  Eigen::Index column = 0;
  for (const auto& [name, members] : cts) {
    std::vector<Told> others;
    others.reserve(told.size());
    for (std::size_t n = 0; n < told.size(); ++n)
      if (std::ranges::find(members, n) == members.end()) others.push_back(told[n]);
    const Fit fit = fitted(others, imagers);
    without.col(column++) = fit.errors.segment(first, kCount);
    for (std::size_t n = 0; n < kImagerParameters; ++n) {
      const Eigen::Index at = first + static_cast<Eigen::Index>(n);
      jackknife.largest_sigmas[n] = std::max(jackknife.largest_sigmas[n], std::sqrt(fit.covariance(at, at)));
    }
  }
  without.colwise() -= without.rowwise().mean().eval();
  const auto count = static_cast<double>(cts.size());
  for (std::size_t n = 0; n < kImagerParameters; ++n)
    jackknife.sigmas[n] = std::sqrt((count - 1.0) / count) * without.row(static_cast<Eigen::Index>(n)).norm();
  return jackknife;
}

ImagerEstimate estimate_of(std::size_t imager, const SessionsByCt& cts, std::span<const Told> told, std::size_t imagers,
                           const Fit& fit) {
  ImagerEstimate estimate;
  const bool are_enough = cts.size() >= kLeastCts;
  const Jackknife jackknife = are_enough ? jackknifed(imager, cts, told, imagers) : Jackknife{};
  for (std::size_t n = 0; n < kImagerParameters; ++n) {
    const ImagerParameterInfo& info = imager_parameters()[n];
    const auto at = static_cast<Eigen::Index>(imager * kImagerParameters + n);
    if (!are_enough || only_balls_tell(static_cast<ImagerParameter>(n)))
      estimate.set(n, 0.0, info.expected);
    else if (jackknife.largest_sigmas[n] > info.largest_sigma)  // a single CT tells it
      estimate.set(n, 0.0, jackknife.largest_sigmas[n]);
    else
      estimate.set(n, fit.errors[at], std::max(std::sqrt(fit.covariance(at, at)), jackknife.sigmas[n]));
  }
  return estimate;
}

}  // namespace

ImagersOfPatients imagers_of_patients(std::span<const PatientSession> sessions, std::size_t imagers) {
  std::vector<Told> told;
  told.reserve(sessions.size());
  for (const PatientSession& session : sessions) told.push_back(told_by(session, imagers));
  if (std::ranges::none_of(told, [](const Told& of) { return of.freedom > 0.0; }))
    throw Error("no session has two views, without which nothing can be told of an imager");
  const Fit fit = fitted(told, imagers);
  ImagersOfPatients found{.imagers = {}, .cts = {}, .misfit = fit.misfit};
  found.imagers.reserve(imagers);
  found.cts.reserve(imagers);
  for (std::size_t imager = 0; imager < imagers; ++imager) {
    const SessionsByCt cts = cts_seen_by(imager, sessions);
    found.imagers.push_back(estimate_of(imager, cts, told, imagers, fit));
    found.cts.push_back(cts.size());
  }
  return found;
}

}  // namespace isoshift
