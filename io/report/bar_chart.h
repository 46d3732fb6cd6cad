#pragma once
// A bar chart as SVG: text and lines, readable in gray.

#include <optional>
#include <string>
#include <vector>

namespace isoshift {

struct BarChart {
  struct Bar {
    double from = 0.0, to = 0.0;  // along x
    double height = 0.0;
  };
  std::string title, x_label, y_label;
  std::vector<Bar> bars;                 // at least one
  std::optional<double> y_max;           // unset: the highest bar
  std::optional<double> reference_line;  // dashed, at this y
};

std::string bar_chart_svg(const BarChart& chart);

}  // namespace isoshift
