#pragma once
// Outlines as JSON, rounded to a tenth of a pixel, for result.json and for the script of report.html.

#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "io/report/view_picture.h"

namespace isoshift {

inline nlohmann::ordered_json polygons_json(const std::vector<Polygon>& polygons) {
  auto list = nlohmann::ordered_json::array();
  for (const Polygon& polygon : polygons) {
    auto points = nlohmann::ordered_json::array();
    for (const Eigen::Vector2d& point : polygon)
      points.push_back({std::round(point.x() * 10.0) / 10.0, std::round(point.y() * 10.0) / 10.0});
    list.push_back(points);
  }
  return list;
}

}  // namespace isoshift
