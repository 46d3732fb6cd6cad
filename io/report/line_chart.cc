#include "io/report/line_chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "io/report/canvas.h"
#include "io/report/ticks.h"

namespace isoshift {
namespace {

using Eigen::Vector2d;

constexpr double kLeftPt = 56.0, kRightPt = 16.0, kTopPt = 46.0, kBottomPt = 44.0;  // margins

constexpr std::array kStyles = {
    LineStyle{.color = color::kBlack, .width = 1.6}, LineStyle{.color = color::kVermilion, .width = 1.6},
    LineStyle{.color = color::kBlue, .width = 1.6, .dashed = true}, LineStyle{.color = color::kOrange, .width = 2.2},
    LineStyle{.color = color::kGray, .width = 1.2, .dashed = true}};

}  // namespace

std::string line_chart_svg(const LineChart& chart, double width, double height) {
  double x_min = 1e300, x_max = -1e300, y_min = chart.from_zero ? 0.0 : 1e300, y_max = -1e300;
  for (const LineChart::Curve& curve : chart.curves)
    for (const auto& [x, y] : curve.points) {
      x_min = std::min(x_min, x);
      x_max = std::max(x_max, x);
      y_min = std::min(y_min, y);
      y_max = std::max(y_max, y);
    }
  if (!(x_max > x_min)) x_max = x_min + 1.0;
  if (!(y_max > y_min)) y_max = y_min + 1.0;
  const auto place = [&](double x, double y) {
    return Vector2d(kLeftPt + (width - kLeftPt - kRightPt) * (x - x_min) / (x_max - x_min),
                    height - kBottomPt - (height - kTopPt - kBottomPt) * (y - y_min) / (y_max - y_min));
  };
  Canvas canvas(Canvas::Kind::kSvg, width, height);
  canvas.fill(0, 0, width, height, color::kWhite);
  using enum TextStyle::Align;
  canvas.text(kLeftPt, 4.0, chart.title, {.size = 13.0, .bold = true});
  for (const double y : ticks(y_min, y_max)) {
    canvas.line(place(x_min, y), place(x_max, y), {.color = color::kLightGray});
    canvas.text(kLeftPt - 6.0, place(x_min, y).y() - 7.0, fmt::format("{:.6g}", y), {.size = 10.0, .align = kRight});
  }
  for (const double x : ticks(x_min, x_max))
    canvas.text(place(x, y_min).x(), height - kBottomPt + 4.0, fmt::format("{:.6g}", x),
                {.size = 10.0, .align = kCenter});
  canvas.text(0.5 * (kLeftPt + width - kRightPt), height - 20.0, chart.x_label, {.size = 11.0, .align = kCenter});
  canvas.text(4.0, kTopPt - 18.0, chart.y_label, {.size = 11.0});
  double legend = width - kRightPt;
  for (std::size_t n = chart.curves.size(); n-- > 0;) {
    const LineChart::Curve& curve = chart.curves[n];
    const LineStyle& style = kStyles[n % kStyles.size()];
    std::vector<Vector2d> points;
    for (const auto& [x, y] : curve.points) points.push_back(place(x, y));
    if (points.size() > 1) canvas.polygon(points, style, false);
    legend -= canvas.text_width(curve.name, {.size = 10.0});
    canvas.text(legend, 24.0, curve.name, {.size = 10.0});
    canvas.line({legend - 24.0, 31.0}, {legend - 4.0, 31.0}, style);
    legend -= 36.0;
  }
  return canvas.finish();
}

}  // namespace isoshift
