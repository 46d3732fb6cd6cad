#include "bodies/spine_curve.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace isoshift {
namespace {

// Each coordinate by a line fitted about each point with Gaussian weights, so that the ends do not shrink inward.
std::vector<Eigen::Vector3d> smoothed(const std::vector<Eigen::Vector3d>& points, double sigma_mm) {
  std::vector<double> along = {0.0};
  for (std::size_t n = 1; n < points.size(); ++n) along.push_back(along.back() + (points[n] - points[n - 1]).norm());
  std::vector<Eigen::Vector3d> result;
  for (std::size_t n = 0; n < points.size(); ++n) {
    double w = 0.0, wx = 0.0, wxx = 0.0;
    Eigen::Vector3d wy = Eigen::Vector3d::Zero(), wxy = Eigen::Vector3d::Zero();
    for (std::size_t m = 0; m < points.size(); ++m) {
      const double x = along[m] - along[n], weight = std::exp(-0.5 * x * x / (sigma_mm * sigma_mm));
      w += weight, wx += weight * x, wxx += weight * x * x;
      wy += weight * points[m], wxy += weight * x * points[m];
    }
    const double det = w * wxx - wx * wx;
    result.emplace_back(det > 1e-6 ? Eigen::Vector3d((wxx * wy - wx * wxy) / det) : points[n]);
  }
  return result;
}

}  // namespace

SpineCurve::SpineCurve(const std::vector<Eigen::Vector3d>& points_patient_mm, double smoothing_mm, int beyond_mm) {
  std::vector<Eigen::Vector3d> smooth = smoothed(points_patient_mm, smoothing_mm);
  const Eigen::Vector3d first = (smooth[0] - smooth[1]).normalized();
  const Eigen::Vector3d last = (smooth.back() - smooth[smooth.size() - 2]).normalized();
  smooth.insert(smooth.begin(), smooth.front() + beyond_mm * first);
  smooth.push_back(smooth.back() + beyond_mm * last);
  double rest = 0.0;
  for (std::size_t n = 0; n + 1 < smooth.size(); ++n) {
    const Eigen::Vector3d way = smooth[n + 1] - smooth[n];
    const int points = std::max(0, static_cast<int>(std::ceil(way.norm() - rest)));
    for (int p = 0; p < points; ++p) points_.emplace_back(smooth[n] + (rest + p) * way.normalized());
    rest += points - way.norm();
  }
}

CurveFrame SpineCurve::frame(double along_mm) const {
  const double last = length() - 1.0, at = std::clamp(along_mm, 0.0, last);
  const auto point = [&](double s) -> Eigen::Vector3d {
    const int n = std::clamp(static_cast<int>(s), 0, length() - 2);
    return points_[n] + (s - n) * (points_[n + 1] - points_[n]);
  };
  constexpr double kChordMm = 8.0;
  const Eigen::Vector3d up = (point(std::min(at + kChordMm, last)) - point(std::max(at - kChordMm, 0.0))).normalized();
  const Eigen::Vector3d left = Eigen::Vector3d::UnitY().cross(up).normalized();
  return {point(at) + (along_mm - at) * up, up, left, up.cross(left)};
}

}  // namespace isoshift
