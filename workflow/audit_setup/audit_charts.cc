#include "workflow/audit_setup/audit_charts.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "geometry/motion_axes.h"
#include "io/report/scatter_chart.h"
#include "workflow/audit_setup/audit_words.h"

namespace isoshift {
namespace {

std::pair<double, double> x_range(const ScatterChart& chart) {
  std::vector<double> xs;
  for (const auto& [x, y] : chart.points.empty() ? chart.marked : chart.points) xs.push_back(x);
  const auto [low, high] = std::ranges::minmax(xs);
  return {low, high};
}

std::string agreement_chart(const SetupAudit& audit, std::size_t axis) {
  ScatterChart chart{.title = kCouchAxes[axis],
                     .x_label = fmt::format("mean of used and found, {}", unit_of(axis)),
                     .y_label = fmt::format("used - found, {}", unit_of(axis))};
  for (std::size_t n = 0; n < audit.sessions.size(); ++n) {
    const AuditedSession& session = audit.sessions[n];
    const auto off = session.difference()[axis];
    if (!off || !session.counts()) continue;
    (audit.outlier_of(n) != nullptr ? chart.marked : chart.points)
        .emplace_back(*session.found[axis] + 0.5 * *off, *off);
  }
  const auto [low, high] = x_range(chart);
  const auto add = [&, from = low, to = high](double y, const char* name, bool dashed) {
    chart.lines.push_back(
        {.points = {{from, y}, {to, y}}, .name = fmt::format("{} {:+.2f}", name, y), .dashed = dashed});
  };
  if (const auto& agreement = audit.axes[axis].without_outliers) {
    add(agreement->bias, "bias", false);
    if (agreement->limit) {
      add(agreement->bias + *agreement->limit, "limit", true);
      add(agreement->bias - *agreement->limit, "limit", true);
    }
  }
  return scatter_chart_svg(chart);
}

// Values over time: with the drift where it is significant, else with their mean.
std::string run_chart(const std::string& title, const std::string& y_label, ScatterChart::Points points,
                      const std::optional<Drift>& drift) {
  ScatterChart chart{.title = title, .y_label = y_label, .points = std::move(points)};
  const auto [first, last] = x_range(chart);
  const bool drifts = drift && drift->is_significant();
  double mean = 0.0;
  for (const auto& [day, value] : chart.points) mean += value / static_cast<double>(chart.points.size());
  ScatterChart::Line line{.name = drifts ? "drift" : "mean"};
  constexpr int kParts = 200;  // so that a step looks like one
  for (int part = 0; part <= kParts; ++part) {
    const double day = first + (last - first) * part / kParts;
    line.points.emplace_back(day, drifts ? drift->at(day) : mean);
  }
  chart.lines.push_back(std::move(line));
  const int dates = last > first ? 4 : 1;
  for (int n = 0; n < dates; ++n) {
    const double day = first + (last - first) * n / std::max(1, dates - 1);
    chart.x_names.emplace_back(day, date_of(day));
  }
  return scatter_chart_svg(chart);
}

}  // namespace

std::vector<std::string> agreement_charts(const SetupAudit& audit) {
  std::vector<std::string> charts;
  for (std::size_t axis = 0; axis < audit.axes.size(); ++axis)
    if (audit.axes[axis].of_all) charts.push_back(agreement_chart(audit, axis));
  return charts;
}

std::vector<std::string> difference_charts(const SetupAudit& audit) {
  std::vector<std::string> charts;
  for (std::size_t axis = 0; axis < audit.axes.size(); ++axis) {
    ScatterChart::Points points;
    for (std::size_t n = 0; n < audit.sessions.size(); ++n) {
      const AuditedSession& session = audit.sessions[n];
      const auto off = session.difference()[axis];
      if (off && session.counts() && audit.outlier_of(n) == nullptr) points.emplace_back(session.day, *off);
    }
    if (!points.empty())
      charts.push_back(run_chart(kCouchAxes[axis], fmt::format("used - found, {}", unit_of(axis)), std::move(points),
                                 audit.axes[axis].drift));
  }
  return charts;
}

std::vector<std::string> setup_charts(const SetupAudit& audit) {
  std::vector<std::string> charts;
  for (std::size_t component = 0; component < kSetupAxes.size(); ++component) {
    ScatterChart::Points points;
    for (const AuditedSession& session : audit.sessions)
      if (session.counts() && session.is_first_of_day && session.setup_error)
        points.emplace_back(session.day, (*session.setup_error)[component]);
    if (!points.empty())
      charts.push_back(run_chart(kSetupAxes[component], fmt::format("setup error, {}", unit_of(component)),
                                 std::move(points), audit.setup_drift[component]));
  }
  return charts;
}

}  // namespace isoshift
