#pragma once
// A chart of points as SVG: single values with what is expected of them.

#include <string>
#include <utility>
#include <vector>

namespace isoshift {

struct ScatterChart {
  using Points = std::vector<std::pair<double, double>>;  // x and y

  std::string title, x_label, y_label;
  Points points;  // dots
  Points marked;  // crosses in a color of their own, such as outliers; far beyond the rest arrows with their value
  struct Line {
    Points points;     // x increasing
    std::string name;  // at its right end
    bool dashed = false;
  };
  std::vector<Line> lines;
  // Texts for places of the x axis, such as dates; empty: numbers.
  std::vector<std::pair<double, std::string>> x_names;
};

std::string scatter_chart_svg(const ScatterChart& chart, double width = 318.0, double height = 205.0);

}  // namespace isoshift
