#include "io/report/bar_chart.h"

#include <cairo-svg.h>
#include <cairo.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "base/error.h"
#include "io/report/ticks.h"

namespace isoshift {
namespace {

constexpr double kWidth = 560.0, kHeight = 340.0;
constexpr double kLeft = 62.0, kRight = 18.0, kTop = 40.0, kBottom = 52.0;

enum class Anchor { kStart, kMiddle, kEnd };

void write_at(cairo_t* context, double x, double y, const std::string& text, Anchor anchor) {
  cairo_text_extents_t extents;
  cairo_text_extents(context, text.c_str(), &extents);
  const double share = anchor == Anchor::kStart ? 0.0 : anchor == Anchor::kMiddle ? 0.5 : 1.0;
  cairo_move_to(context, x - share * extents.x_advance, y);
  cairo_show_text(context, text.c_str());
}

// From numbers to places on the page.
struct Axes {
  double x_min, x_max, y_max;
  double x(double value) const { return kLeft + (kWidth - kLeft - kRight) * (value - x_min) / (x_max - x_min); }
  double y(double value) const { return kHeight - kBottom - (kHeight - kTop - kBottom) * value / y_max; }
};

void draw_axes(cairo_t* context, const Axes& axes, const BarChart& chart) {
  cairo_set_font_size(context, 11.0);
  for (const double tick : ticks(0.0, axes.y_max)) {
    cairo_set_source_rgb(context, 0.88, 0.88, 0.88);
    cairo_move_to(context, kLeft, axes.y(tick));
    cairo_line_to(context, kWidth - kRight, axes.y(tick));
    cairo_stroke(context);
    cairo_set_source_rgb(context, 0.0, 0.0, 0.0);
    write_at(context, kLeft - 6.0, axes.y(tick) + 4.0, fmt::format("{:.6g}", tick), Anchor::kEnd);
  }
  for (const double tick : ticks(axes.x_min, axes.x_max))
    write_at(context, axes.x(tick), kHeight - kBottom + 16.0, fmt::format("{:.6g}", tick), Anchor::kMiddle);
  cairo_set_font_size(context, 12.0);
  write_at(context, 0.5 * (kLeft + kWidth - kRight), kHeight - 14.0, chart.x_label, Anchor::kMiddle);
  write_at(context, 14.0, kTop - 10.0, chart.y_label, Anchor::kStart);
  cairo_set_font_size(context, 13.0);
  write_at(context, 0.5 * kWidth, 18.0, chart.title, Anchor::kMiddle);
}

void draw(cairo_t* context, const BarChart& chart) {
  Axes axes{.x_min = chart.bars.front().from, .x_max = chart.bars.back().to, .y_max = chart.y_max.value_or(0.0)};
  for (const BarChart::Bar& bar : chart.bars) {
    axes.x_min = std::min(axes.x_min, bar.from);
    axes.x_max = std::max(axes.x_max, bar.to);
    if (!chart.y_max) axes.y_max = std::max(axes.y_max, bar.height);
  }
  if (!(axes.y_max > 0.0)) axes.y_max = 1.0;

  cairo_set_source_rgb(context, 1.0, 1.0, 1.0);
  cairo_paint(context);
  cairo_set_line_width(context, 1.0);
  cairo_select_font_face(context, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  draw_axes(context, axes, chart);
  for (const BarChart::Bar& bar : chart.bars) {
    cairo_rectangle(context, axes.x(bar.from) + 0.5, axes.y(bar.height), axes.x(bar.to) - axes.x(bar.from) - 1.0,
                    axes.y(0.0) - axes.y(bar.height));
    cairo_set_source_rgb(context, 0.16, 0.38, 0.58);
    cairo_fill(context);
  }
  cairo_set_source_rgb(context, 0.0, 0.0, 0.0);
  if (chart.reference_line) {
    static constexpr double kDashes[] = {5.0, 4.0};
    cairo_set_dash(context, kDashes, 2, 0.0);
    cairo_move_to(context, kLeft, axes.y(*chart.reference_line));
    cairo_line_to(context, kWidth - kRight, axes.y(*chart.reference_line));
    cairo_stroke(context);
    cairo_set_dash(context, nullptr, 0, 0.0);
  }
  cairo_move_to(context, kLeft, kTop);
  cairo_line_to(context, kLeft, kHeight - kBottom);
  cairo_line_to(context, kWidth - kRight, kHeight - kBottom);
  cairo_stroke(context);
}

}  // namespace

std::string bar_chart_svg(const BarChart& chart) {
  std::string svg;
  const auto append = [](void* closure, const unsigned char* bytes, unsigned int count) {
    static_cast<std::string*>(closure)->append(reinterpret_cast<const char*>(bytes), count);
    return CAIRO_STATUS_SUCCESS;
  };
  const std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)> surface(
      cairo_svg_surface_create_for_stream(append, &svg, kWidth, kHeight), &cairo_surface_destroy);
  {
    const std::unique_ptr<cairo_t, decltype(&cairo_destroy)> context(cairo_create(surface.get()), &cairo_destroy);
    draw(context.get(), chart);
  }
  cairo_surface_finish(surface.get());
  if (const auto status = cairo_surface_status(surface.get()); status != CAIRO_STATUS_SUCCESS)
    throw Error(fmt::format("a chart cannot be drawn: {}", cairo_status_to_string(status)));
  return svg;
}

}  // namespace isoshift
