#include "registration/imager/bundle_adjustment.h"

#include <ceres/ceres.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>

#include "base/error.h"
#include "base/median.h"
#include "geometry/linear_algebra.h"
#include "registration/pose_parameters.h"

namespace isoshift {
namespace {

using PoseBlock = std::array<double, 6>;  // parameters of setup_error_from_parameters()
using BallBlock = std::array<double, 3>;  // of a center, against the CT's, mm along the patient's axes

constexpr double kExpectedPoseMm = 50.0;  // one standard deviation of a free pose before anything is measured
constexpr double kBallMm = 0.1;           // the same of a ball's center along an axis, as the CT gives it
constexpr double kLeastNoiseMm = 0.003;   // on the receptor
constexpr double kLeastShare = 0.6;       // of the places of a session, in the end
constexpr double kRobustSigmas = 3.0;     // beyond these a place counts less and less

// Where a ball of one session is seen in one view.
struct Sight {
  const BallSession* session = nullptr;
  const BallView* view = nullptr;
  std::size_t pose = 0, ball = 0;
  Eigen::Vector2d place_px = Eigen::Vector2d::Zero();
};

Eigen::Isometry3d pose_of(const BallSession& session, BallPoses poses, const double* block) {
  const Eigen::Isometry3d setup_error = setup_error_from_parameters(std::span(block, 6));
  return (poses == BallPoses::kFree ? setup_error : session.known_setup_error * setup_error) *
         session.planned_room_from_patient;
}

// How far from where it is seen a ball is expected, in noises.
struct SightCost {
  Sight sight;
  Eigen::Vector3d ball_patient_mm;
  BallPoses poses;
  double noise_mm;

  bool operator()(const double* imager, const double* pose, const double* ball, double* residual) const {
    ImagerErrors errors;
    std::copy_n(imager, errors.size(), errors.begin());
    const Eigen::Vector3d center_mm = ball_patient_mm + Eigen::Map<const Eigen::Vector3d>(ball);
    const Eigen::Vector2d expected_px =
        sight.view->model.pixel_of(pose_of(*sight.session, poses, pose) * center_mm, errors);
    Eigen::Map<Eigen::Vector2d>(residual, 2) = sight.view->model.pixel_mm() / noise_mm * (expected_px - sight.place_px);
    return true;
  }
};

// What is expected of a block before anything is measured.
template <int kSize>
struct PriorCost {
  std::array<double, kSize> expected;

  bool operator()(const double* block, double* residual) const {
    for (int n = 0; n < kSize; ++n) residual[n] = block[n] / expected[static_cast<std::size_t>(n)];
    return true;
  }
};

class Adjustment {
 public:
  Adjustment(const std::vector<Ball>& balls, const std::vector<BallSession>& sessions, BallPoses poses,
             std::size_t imagers)
      : balls_(balls), sessions_(sessions), poses_(poses), imagers_(imagers, ImagerErrors{}) {
    pose_blocks_.resize(poses == BallPoses::kFree ? sessions.size() : 1, PoseBlock{});
    ball_blocks_.resize(balls.size(), BallBlock{});
  }

  BundleAdjustment run() {
    const char* const is_it_the_phantom =
        poses_ == BallPoses::kFree
            ? "Is this the CT of that phantom, within 10 mm and 5 degrees of its plan?"
            : "Is this the CT of that phantom, and does it lie within 10 mm and 5 degrees of where the CSV file says? "
              "Check its signs and axes (IEC 61217 fixed).";
    // Poses first, from the places nearest to where balls are expected; then all, from ever nearer ones.
    for (const double within_mm : {20.0, 10.0}) {
      look(within_mm);
      require_seen(0.0, is_it_the_phantom);
      solve(within_mm / 10.0, false);
    }
    for (const double within_mm : {6.0, 3.0, 2.0}) {
      look(within_mm);
      require_seen(0.0, is_it_the_phantom);
      solve(noise_mm(), true);
    }
    require_seen(kLeastShare, "Is its pose, or its move, the one that the CSV file says, with the right sign?");
    return result();
  }

 private:
  std::size_t pose_of_session(std::size_t session) const { return poses_ == BallPoses::kFree ? session : 0; }

  Eigen::Vector2d expected_px(const Sight& sight) const {
    const Eigen::Vector3d center_mm =
        balls_[sight.ball].center_patient_mm + Eigen::Map<const Eigen::Vector3d>(ball_blocks_[sight.ball].data());
    return sight.view->model.pixel_of(pose_of(*sight.session, poses_, pose_blocks_[sight.pose].data()) * center_mm,
                                      imagers_[sight.view->imager]);
  }

  // Whether another ball is expected so near that the two spots disturb each other.
  static bool is_crowded(std::size_t ball, const std::vector<Eigen::Vector2d>& expected, double radius_px) {
    constexpr double kRadii = 4.0;
    for (std::size_t other = 0; other < expected.size(); ++other)
      if (other != ball && (expected[other] - expected[ball]).norm() < kRadii * radius_px) return true;
    return false;
  }

  // Whether a view should show a ball at that place: it is in the irradiated field, and not clipped.
  static bool is_shown(const Eigen::Vector2d& place, const BallView& view) {
    const Image<std::uint8_t>& field = view.spots.field;
    const auto is_in_field = [&](double u, double v) {
      const Eigen::Vector2d at = place + view.radius_px * Eigen::Vector2d(u, v);
      return at.x() >= 0.0 && at.y() >= 0.0 && at.x() <= field.columns - 1 && at.y() <= field.rows - 1 &&
             field.at(static_cast<int>(std::lround(at.x())), static_cast<int>(std::lround(at.y()))) != 0;
    };
    return is_in_field(0.0, 0.0) && is_in_field(-1.0, 0.0) && is_in_field(1.0, 0.0) && is_in_field(0.0, -1.0) &&
           is_in_field(0.0, 1.0);
  }

  // Takes for every ball the nearest spot of every view, if it lies near enough and is no other ball's nearest.
  void look(double within_mm) {
    sights_.clear();
    expected_.clear();
    for (std::size_t session = 0; session < sessions_.size(); ++session) {
      std::size_t& places = expected_[&sessions_[session]];
      for (const BallView& view : sessions_[session].views) {
        std::vector<Sight> sights;
        std::vector<Eigen::Vector2d> expected;
        for (std::size_t ball = 0; ball < balls_.size(); ++ball) {
          sights.push_back({.session = &sessions_[session],
                            .view = &view,
                            .pose = pose_of_session(session),
                            .ball = ball,
                            .place_px = Eigen::Vector2d::Zero()});
          expected.push_back(expected_px(sights.back()));
        }
        const std::vector<Eigen::Vector2d>& spots = view.spots.places;
        std::vector<Sight> nearest(spots.size());
        std::vector<double> distance(spots.size(), std::numeric_limits<double>::infinity());
        for (std::size_t ball = 0; ball < balls_.size(); ++ball) {
          if (is_crowded(ball, expected, view.radius_px)) continue;
          const auto spot = std::ranges::min_element(
              spots, {}, [&](const Eigen::Vector2d& place) { return (place - expected[ball]).squaredNorm(); });
          const double mm = spot == spots.end() ? std::numeric_limits<double>::infinity()
                                                : view.model.pixel_mm() * (*spot - expected[ball]).norm();
          if (mm <= within_mm || is_shown(expected[ball], view)) ++places;
          const auto n = static_cast<std::size_t>(spot - spots.begin());
          if (mm > within_mm || mm >= distance[n]) continue;
          distance[n] = mm;
          nearest[n] = sights[ball];
          nearest[n].place_px = *spot;
        }
        for (std::size_t n = 0; n < nearest.size(); ++n)
          if (std::isfinite(distance[n])) sights_.push_back(nearest[n]);
      }
    }
  }

  // Every session must show the most of its balls: one that does not was given a pose that is not its own, or another
  // phantom.
  void require_seen(double share, const char* advice) const {
    for (const BallSession& session : sessions_) {
      const auto is_of = [&](const Sight& sight) { return sight.session == &session; };
      const auto seen = static_cast<std::size_t>(std::ranges::count_if(sights_, is_of));
      const std::size_t expected = expected_.at(&session);
      if (expected == 0)
        throw Error(
            fmt::format("session {}: its X-rays should show no ball alone: all lie outside the irradiated "
                        "fields, hide each other, or are clipped to the ends of the pixels' range. {}",
                        session.name, advice));
      constexpr std::size_t kLeast = 3;  // a shift of the phantom needs two places; what is told beyond that, more
      if (seen < kLeast || static_cast<double>(seen) < share * static_cast<double>(expected))
        throw Error(fmt::format("session {}: of {} places at which the X-rays should show balls, {} do. {}",
                                session.name, expected, seen, advice));
    }
  }

  // Of what remains, per axis on the receptor, whatever outliers there are.
  double noise_mm() const {
    constexpr double kNormal = 1.4826;
    std::vector<double> sizes;
    for (const Sight& sight : sights_) {
      const Eigen::Vector2d apart = sight.view->model.pixel_mm() * (expected_px(sight) - sight.place_px);
      sizes.push_back(std::abs(apart.x()));
      sizes.push_back(std::abs(apart.y()));
    }
    return std::max(kLeastNoiseMm, kNormal * median(sizes));
  }

  std::unique_ptr<ceres::Problem> problem(double noise) {
    auto problem = std::make_unique<ceres::Problem>();
    for (const Sight& sight : sights_)
      problem->AddResidualBlock(
          new ceres::NumericDiffCostFunction<SightCost, ceres::CENTRAL, 2, kImagerParameters, 6, 3>(
              new SightCost{sight, balls_[sight.ball].center_patient_mm, poses_, noise}),
          new ceres::CauchyLoss(kRobustSigmas), imagers_[sight.view->imager].data(), pose_blocks_[sight.pose].data(),
          ball_blocks_[sight.ball].data());
    std::array<double, kImagerParameters> expected{};
    std::ranges::transform(imager_parameters(), expected.begin(), &ImagerParameterInfo::expected);
    for (ImagerErrors& imager : imagers_)
      problem->AddResidualBlock(
          new ceres::NumericDiffCostFunction<PriorCost<kImagerParameters>, ceres::CENTRAL, kImagerParameters,
                                             kImagerParameters>(new PriorCost<kImagerParameters>{expected}),
          nullptr, imager.data());
    PoseBlock expected_pose{};
    expected_pose.fill(kExpectedPoseMm);
    for (PoseBlock& pose : pose_blocks_) {
      problem->AddResidualBlock(
          new ceres::NumericDiffCostFunction<PriorCost<6>, ceres::CENTRAL, 6, 6>(new PriorCost<6>{expected_pose}),
          nullptr, pose.data());
      if (poses_ == BallPoses::kPositions) problem->SetParameterBlockConstant(pose.data());
    }
    BallBlock expected_ball{};
    expected_ball.fill(kBallMm);
    for (BallBlock& ball : ball_blocks_)
      problem->AddResidualBlock(
          new ceres::NumericDiffCostFunction<PriorCost<3>, ceres::CENTRAL, 3, 3>(new PriorCost<3>{expected_ball}),
          nullptr, ball.data());
    return problem;
  }

  void solve(double noise, bool with_imagers) {
    noise_mm_ = noise;
    const auto least_squares = problem(noise);
    if (!with_imagers) {
      if (poses_ == BallPoses::kPositions) return;
      for (ImagerErrors& imager : imagers_) least_squares->SetParameterBlockConstant(imager.data());
      for (BallBlock& ball : ball_blocks_) least_squares->SetParameterBlockConstant(ball.data());
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_QR;
    options.max_num_iterations = 100;
    options.function_tolerance = 1e-10;
    options.logging_type = ceres::SILENT;
    ceres::Solver::Summary summary;
    ceres::Solve(options, least_squares.get(), &summary);
    if (!summary.IsSolutionUsable()) throw Error("the geometry cannot be solved: " + summary.message);
  }

  // Of all parameters that were estimated: the imagers, then the poses unless they are known, then the balls.
  Eigen::MatrixXd covariance() {
    solve(noise_mm(), true);
    const auto least_squares = problem(noise_mm_);
    ceres::Problem::EvaluateOptions options;
    for (ImagerErrors& imager : imagers_) options.parameter_blocks.push_back(imager.data());
    if (poses_ != BallPoses::kPositions)
      for (PoseBlock& pose : pose_blocks_) options.parameter_blocks.push_back(pose.data());
    for (BallBlock& ball : ball_blocks_) options.parameter_blocks.push_back(ball.data());
    ceres::CRSMatrix sparse;
    least_squares->Evaluate(options, nullptr, nullptr, nullptr, &sparse);
    Eigen::MatrixXd jacobian = Eigen::MatrixXd::Zero(sparse.num_rows, sparse.num_cols);
    for (int row = 0; row < sparse.num_rows; ++row)
      for (int n = sparse.rows[static_cast<std::size_t>(row)]; n < sparse.rows[static_cast<std::size_t>(row) + 1]; ++n)
        jacobian(row, sparse.cols[static_cast<std::size_t>(n)]) = sparse.values[static_cast<std::size_t>(n)];
    const Eigen::MatrixXd information = transposed_product(jacobian, jacobian);
    return solve_symmetric(information, Eigen::MatrixXd::Identity(information.rows(), information.cols()));
  }

  void add_pose_sigmas(const Eigen::MatrixXd& variances, BundleAdjustment& adjustment) const {
    const auto begin = static_cast<Eigen::Index>(imagers_.size() * kImagerParameters);
    for (std::size_t session = 0; session < sessions_.size(); ++session)
      for (std::size_t n = 0; n < 6; ++n) {
        const Eigen::Index first = begin + static_cast<Eigen::Index>(n);
        const Eigen::Index at = first + static_cast<Eigen::Index>(6 * pose_of_session(session));
        const double unit = n < 3 ? 1.0 : kLeverMm;
        const double against_first = variances(at, at) + variances(first, first) - 2.0 * variances(at, first);
        adjustment.pose_sigmas[session][n] = std::sqrt(variances(at, at)) / unit;
        adjustment.move_sigmas[session][n] = std::sqrt(std::max(0.0, against_first)) / unit;
      }
  }

  BundleAdjustment result() {
    const Eigen::MatrixXd variances = covariance();
    BundleAdjustment adjustment{.seen = sights_.size()};
    for (const auto& [session, expected] : expected_) adjustment.expected += expected;
    for (std::size_t imager = 0; imager < imagers_.size(); ++imager) {
      ImagerEstimate& estimate = adjustment.imagers.emplace_back();
      for (std::size_t n = 0; n < kImagerParameters; ++n) {
        const auto at = static_cast<Eigen::Index>(imager * kImagerParameters + n);
        estimate.set(n, imagers_[imager][n], std::sqrt(variances(at, at)));
      }
    }
    for (std::size_t session = 0; session < sessions_.size(); ++session)
      adjustment.setup_errors.push_back(
          pose_of(sessions_[session], poses_, pose_blocks_[pose_of_session(session)].data()) *
          sessions_[session].planned_room_from_patient.inverse());
    adjustment.pose_sigmas.assign(sessions_.size(), {});
    adjustment.move_sigmas.assign(sessions_.size(), {});
    if (poses_ != BallPoses::kPositions) add_pose_sigmas(variances, adjustment);
    double squares = 0.0;
    for (const Sight& sight : sights_)
      squares += (sight.view->model.pixel_mm() * (expected_px(sight) - sight.place_px)).squaredNorm();
    adjustment.rms_mm = std::sqrt(squares / (2.0 * static_cast<double>(sights_.size())));
    return adjustment;
  }

  const std::vector<Ball>& balls_;
  const std::vector<BallSession>& sessions_;
  BallPoses poses_;
  std::vector<ImagerErrors> imagers_;
  std::vector<PoseBlock> pose_blocks_;
  std::vector<BallBlock> ball_blocks_;
  std::vector<Sight> sights_;
  std::map<const BallSession*, std::size_t> expected_;  // places that the views of a session could show
  double noise_mm_ = 1.0;
};

}  // namespace

BundleAdjustment adjusted(const std::vector<Ball>& balls, const std::vector<BallSession>& sessions, BallPoses poses,
                          std::size_t imagers) {
  return Adjustment(balls, sessions, poses, imagers).run();
}

}  // namespace isoshift
