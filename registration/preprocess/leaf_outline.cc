#include "registration/preprocess/leaf_outline.h"

#include <algorithm>
#include <cmath>

namespace isoshift {
namespace {

constexpr double kApartMm = 1.0;         // of the places along the outline that are looked at
constexpr double kAcrossMm = 2.0;        // inside and outside of it the intensities are compared
constexpr double kMostShiftMm = 3.0;     // of the outline along each axis
constexpr double kShiftStepMm = 0.5;     // of shifts
constexpr double kDarkest = 1e-3;        // of the brightest intensity
constexpr double kMostFall = 1.5;        // logarithm: a fall by more counts no more
constexpr double kSeenFall = 0.35;       // logarithm of the fall across an edge, a factor of 1.4
constexpr double kLeastSeen = 0.75;      // of the outline
constexpr double kLeastLookedAtMm = 40;  // of outline on the receptor

// A place on the outline, and the direction into the field.
struct OutlinePlace {
  Eigen::Vector2d at_px, inward;
};

double doubled_area(const std::vector<Eigen::Vector2d>& polygon) {
  double area = 0.0;
  for (std::size_t n = 0; n < polygon.size(); ++n) {
    const Eigen::Vector2d &here = polygon[n], &next = polygon[(n + 1) % polygon.size()];
    area += here.x() * next.y() - here.y() * next.x();
  }
  return area;
}

std::vector<OutlinePlace> places_on(const std::vector<Eigen::Vector2d>& outline_px, double pixel_mm) {
  const double side = doubled_area(outline_px) > 0.0 ? 1.0 : -1.0;
  std::vector<OutlinePlace> places;
  for (std::size_t n = 0; n < outline_px.size(); ++n) {
    const Eigen::Vector2d &here = outline_px[n], &next = outline_px[(n + 1) % outline_px.size()];
    const Eigen::Vector2d along = next - here;
    const int count = static_cast<int>(along.norm() * pixel_mm / kApartMm);
    const Eigen::Vector2d inward = side * Eigen::Vector2d(-along.y(), along.x()).normalized();
    for (int place = 0; place < count; ++place) places.push_back({here + (place + 0.5) / count * along, inward});
  }
  return places;
}

// The logarithm of the intensity; nothing beyond the receptor.
std::optional<double> logarithm_at(const UprightXray& xray, const Eigen::Vector2d& at_px) {
  const int column = static_cast<int>(std::floor(at_px.x())), row = static_cast<int>(std::floor(at_px.y()));
  if (column < 0 || row < 0 || column >= xray.intensity.cols || row >= xray.intensity.rows) return std::nullopt;
  if (xray.valid.at<std::uint8_t>(row, column) == 0) return std::nullopt;
  return std::log(xray.intensity.at<float>(row, column) + kDarkest);
}

// How the image darkens across the shifted outline.
struct Seen {
  double mean_fall = -1.0, share = 0.0;
};

Seen seen_of(const UprightXray& xray, const std::vector<OutlinePlace>& places, const Eigen::Vector2d& shift_px) {
  double falls = 0.0;
  int looked_at = 0, fallen = 0;
  for (const OutlinePlace& place : places) {
    const Eigen::Vector2d at = place.at_px + shift_px, across = kAcrossMm / xray.mm * place.inward;
    const auto inside = logarithm_at(xray, at + across), outside = logarithm_at(xray, at - across);
    if (!inside || !outside) continue;
    ++looked_at;
    fallen += *inside - *outside >= kSeenFall;
    falls += std::clamp(*inside - *outside, -kMostFall, kMostFall);
  }
  if (looked_at * kApartMm < kLeastLookedAtMm) return {};
  return {.mean_fall = falls / looked_at, .share = static_cast<double>(fallen) / looked_at};
}

}  // namespace

std::optional<Eigen::Vector2d> shift_to_seen_outline(const UprightXray& xray,
                                                     const std::vector<Eigen::Vector2d>& outline_px) {
  const std::vector<OutlinePlace> places = places_on(outline_px, xray.mm);
  const int steps = static_cast<int>(std::lround(kMostShiftMm / kShiftStepMm));
  Seen best;
  Eigen::Vector2d best_shift_px = Eigen::Vector2d::Zero();
  for (int across = -steps; across <= steps; ++across)
    for (int down = -steps; down <= steps; ++down) {
      const Eigen::Vector2d shift_px = kShiftStepMm / xray.mm * Eigen::Vector2d(across, down);
      const Seen seen = seen_of(xray, places, shift_px);
      if (seen.mean_fall <= best.mean_fall) continue;
      best = seen;
      best_shift_px = shift_px;
    }
  return best.share >= kLeastSeen ? std::optional(best_shift_px) : std::nullopt;
}

}  // namespace isoshift
