#pragma once
// A chart of curves as SVG. The dashes of the curves tell them apart in gray.

#include <string>
#include <utility>
#include <vector>

namespace isoshift {

struct LineChart {
  struct Curve {
    std::string name;
    std::vector<std::pair<double, double>> points;  // x and y, x increasing
  };
  std::string title, x_label, y_label;
  std::vector<Curve> curves;
  bool from_zero = true;  // the y axis begins at 0
};

std::string line_chart_svg(const LineChart& chart, double width = 640.0, double height = 360.0);

}  // namespace isoshift
