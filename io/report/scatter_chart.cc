#include "io/report/scatter_chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "io/report/canvas.h"
#include "io/report/ticks.h"

namespace isoshift {
namespace {

using Eigen::Vector2d;

constexpr double kLeftPt = 36.0, kRightPt = 56.0, kTopPt = 38.0, kBottomPt = 34.0;  // margins
constexpr double kAirShare = 0.05;                                                  // free on each side of the points

struct Range {
  double low = 0.0, high = 0.0;

  // Of all values, but of those marked only what lies near the others: a far outlier would press the rest into a line.
  static Range of(const std::vector<double>& values, const std::vector<double>& marked) {
    constexpr double kNearShare = 0.5;  // of the range of the others
    if (values.empty() && marked.empty()) return {-1.0, 1.0};
    const auto [least, most] = std::ranges::minmax(values.empty() ? marked : values);
    const double near = most > least ? kNearShare * (most - least) : INFINITY;
    double low = least, high = most;
    for (const double value : marked) {
      low = std::min(low, std::max(value, least - near));
      high = std::max(high, std::min(value, most + near));
    }
    const double air = high > low ? kAirShare * (high - low) : 1.0;
    return {low - air, high + air};
  }
  double nearest_to(double value) const { return std::clamp(value, low, high); }
};

void dot(Canvas& canvas, const Vector2d& at) {
  constexpr double kRadiusPt = 1.3;
  canvas.circle(at, kRadiusPt, {.color = color::kBlue, .width = 1.0});
}

void cross(Canvas& canvas, const Vector2d& at) {
  constexpr double kArmPt = 3.0;
  const LineStyle style{.color = color::kVermilion, .width = 1.5};
  canvas.line(at - Vector2d(kArmPt, kArmPt), at + Vector2d(kArmPt, kArmPt), style);
  canvas.line(at - Vector2d(kArmPt, -kArmPt), at + Vector2d(kArmPt, -kArmPt), style);
}

// What lies beyond the chart: an arrow at its edge, with the value.
void beyond(Canvas& canvas, const Vector2d& edge, const Vector2d& outward, const std::string& value) {
  constexpr double kArrowPt = 13.0, kGapPt = 2.0, kSizePt = 7.5;
  const Vector2d way(outward.x() == 0.0 ? 0.0 : std::copysign(1.0, outward.x()),
                     outward.y() == 0.0 ? 0.0 : std::copysign(1.0, outward.y()));
  const Vector2d from = edge - kArrowPt * way.normalized();
  canvas.arrow(from, edge, {.color = color::kVermilion, .width = 1.5});
  const bool is_left = way.x() > 0.0;  // of the arrow, away from the edge
  canvas.text(from.x() + (is_left ? -kGapPt : kGapPt), from.y() - 0.6 * kSizePt, value,
              {.size = kSizePt,
               .color = color::kVermilion,
               .align = is_left ? TextStyle::Align::kRight : TextStyle::Align::kLeft});
}

}  // namespace

std::string scatter_chart_svg(const ScatterChart& chart, double width, double height) {
  std::vector<double> xs, ys, marked_xs, marked_ys;
  const auto add = [](const ScatterChart::Points& points, std::vector<double>& to_xs, std::vector<double>& to_ys) {
    for (const auto& [x, y] : points) {
      to_xs.push_back(x);
      to_ys.push_back(y);
    }
  };
  add(chart.points, xs, ys);
  add(chart.marked, marked_xs, marked_ys);
  for (const ScatterChart::Line& line : chart.lines) add(line.points, xs, ys);
  const Range x_range = Range::of(xs, marked_xs), y_range = Range::of(ys, marked_ys);
  const auto place = [&](double x, double y) {
    return Vector2d(
        kLeftPt + (width - kLeftPt - kRightPt) * (x - x_range.low) / (x_range.high - x_range.low),
        height - kBottomPt - (height - kTopPt - kBottomPt) * (y - y_range.low) / (y_range.high - y_range.low));
  };
  Canvas canvas(Canvas::Kind::kSvg, width, height);
  canvas.fill(0, 0, width, height, color::kWhite);
  using enum TextStyle::Align;
  canvas.text(kLeftPt, 4.0, chart.title, {.size = 10.5, .bold = true});
  canvas.text(4.0, kTopPt - 16.0, chart.y_label, {.size = 8.0});
  canvas.text(0.5 * (kLeftPt + width - kRightPt), height - 14.0, chart.x_label, {.size = 8.0, .align = kCenter});
  for (const double y : ticks(y_range.low, y_range.high)) {
    canvas.line(place(x_range.low, y), place(x_range.high, y), {.color = color::kLightGray});
    canvas.text(kLeftPt - 5.0, place(x_range.low, y).y() - 6.0, fmt::format("{:.6g}", y),
                {.size = 7.5, .align = kRight});
  }
  const auto name_x = [&](double x, const std::string& name) {
    canvas.text(place(x, y_range.low).x(), height - kBottomPt + 3.0, name, {.size = 7.5, .align = kCenter});
  };
  if (chart.x_names.empty())
    for (const double x : ticks(x_range.low, x_range.high)) name_x(x, fmt::format("{:.6g}", x));
  for (const auto& [x, name] : chart.x_names) name_x(x, name);
  for (const auto& [x, y] : chart.points) dot(canvas, place(x, y));
  for (const auto& [x, y] : chart.marked) {
    const double x_shown = x_range.nearest_to(x), y_shown = y_range.nearest_to(y);
    const Vector2d at = place(x_shown, y_shown);
    if (x_shown == x && y_shown == y)
      cross(canvas, at);
    else
      beyond(canvas, at, {x - x_shown, y_shown - y}, fmt::format("{:+.3g}", y_shown == y ? x : y));
  }
  for (const ScatterChart::Line& line : chart.lines) {
    std::vector<Vector2d> points;
    for (const auto& [x, y] : line.points) points.push_back(place(x, y));
    canvas.polygon(points, {.color = color::kBlack, .width = 1.1, .dashed = line.dashed}, false);
    canvas.text(points.back().x() + 4.0, points.back().y() - 6.0, line.name, {.size = 7.5});
  }
  return canvas.finish();
}

}  // namespace isoshift
