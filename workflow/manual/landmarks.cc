#include "workflow/manual/landmarks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/error.h"
#include "geometry/linear_algebra.h"
#include "geometry/rotation.h"

namespace isoshift {
namespace {

constexpr double kLeastAngleRad = rad_from_deg(10.0);  // between the rays of two views
constexpr double kLeastApartMm = 1.0;                  // of two landmarks
constexpr double kLeastBesideMm = 3.0;                 // of several from a line: root mean square

struct Meeting {
  Eigen::Vector3d point_room_mm = Eigen::Vector3d::Zero();
  double apart_mm = 0.0;  // its largest distance from a ray
};

// Where the rays to the marks come nearest to each other, in the sense of least squares.
Meeting meeting(std::span<const XrayView> views, const std::vector<std::optional<Eigen::Vector2d>>& marks,
                const std::string& where) {
  Eigen::Matrix3d normals = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  std::vector<Ray> rays;
  for (std::size_t n = 0; n < views.size(); ++n)
    if (n < marks.size() && marks[n]) rays.push_back(views[n].ray(marks[n]->x(), marks[n]->y()));
  if (rays.size() < 2) throw Error(fmt::format("{}: mark it in at least two views", where));
  const auto across = [](const Ray& ray) -> Eigen::Matrix3d {
    const Eigen::Vector3d along = (ray.pixel_room_mm - ray.source_room_mm).normalized();
    return Eigen::Matrix3d::Identity() - along * along.transpose();
  };
  for (const Ray& ray : rays) {
    normals += across(ray);
    sum += across(ray) * ray.source_room_mm;
  }
  // Of two rays the smallest eigenvalue is 1 - cos of the angle between them.
  if (symmetric_eigen(normals).values[0] < 1.0 - std::cos(kLeastAngleRad))
    throw Error(fmt::format("{}: the views look from nearly one direction", where));
  Meeting result{.point_room_mm = solve_symmetric(normals, sum)};
  for (const Ray& ray : rays)
    result.apart_mm = std::max(result.apart_mm, (across(ray) * (result.point_room_mm - ray.source_room_mm)).norm());
  return result;
}

bool are_on_a_line(const Eigen::Matrix3Xd& points) {
  const Eigen::Matrix3Xd centered = points.colwise() - points.rowwise().mean().eval();
  const Eigen::Matrix3d spread = centered * centered.transpose() / static_cast<double>(points.cols());
  return symmetric_eigen(spread).values[1] < kLeastBesideMm * kLeastBesideMm;
}

}  // namespace

LandmarkFit fit_landmarks(std::span<const XrayView> views, std::span<const Landmark> landmarks,
                          const Eigen::Isometry3d& current) {
  if (landmarks.empty()) throw Error("No landmark is marked");
  LandmarkFit fit;
  const auto count = static_cast<Eigen::Index>(landmarks.size());
  Eigen::Matrix3Xd in_drrs(3, count), in_xrays(3, count);
  for (Eigen::Index n = 0; n < count; ++n) {
    const Landmark& landmark = landmarks[static_cast<std::size_t>(n)];
    const Meeting drr = meeting(views, landmark.in_drrs, fmt::format("Landmark {} in the DRRs", n + 1)),
                  xray = meeting(views, landmark.in_xrays, fmt::format("Landmark {} in the X-rays", n + 1));
    in_drrs.col(n) = drr.point_room_mm;
    in_xrays.col(n) = xray.point_room_mm;
    fit.apart_mm = std::max({fit.apart_mm, drr.apart_mm, xray.apart_mm});
    for (const Eigen::Matrix3Xd* points : {&in_drrs, &in_xrays})
      for (Eigen::Index other = 0; other < n; ++other)
        if ((points->col(n) - points->col(other)).norm() < kLeastApartMm)
          throw Error(fmt::format("Landmarks {} and {} are at one place", other + 1, n + 1));
  }
  if (count > 2 && (are_on_a_line(in_drrs) || are_on_a_line(in_xrays)))
    throw Error("The landmarks lie on a line, about which the patient could be turned: mark another beside it");
  const Eigen::Isometry3d motion = rigid_motion_between(in_drrs, in_xrays);
  fit.setup_error = motion * current;
  if (!fit.setup_error.matrix().allFinite()) throw Error("The landmarks lie too far away");
  const Eigen::Matrix3Xd left = (motion * in_drrs) - in_xrays;
  fit.left_mm = std::sqrt(left.squaredNorm() / static_cast<double>(count));
  return fit;
}

}  // namespace isoshift
