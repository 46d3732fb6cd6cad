#include "registration/preprocess/image_operations.h"

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "registration/preprocess/mat.h"

namespace isoshift {
namespace {

cv::Rect rectangle(const PixelSquare& square) { return {square.column, square.row, square.edge, square.edge}; }

// The top of a parabola through three values, from the middle one.
double top_of(float before, float at, float after) {
  const float curvature = before - 2.0F * at + after;
  return curvature < 0.0F ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0.0;
}

}  // namespace

Image<float> high_pass(const Image<float>& image, double sigma_px) {
  Image<float> result(image.columns, image.rows);
  cv::Mat slow, fast = mat_of(result);
  cv::GaussianBlur(mat_of(image), slow, cv::Size(0, 0), sigma_px, sigma_px, cv::BORDER_REPLICATE);
  cv::subtract(mat_of(image), slow, fast);
  return result;
}

Image<std::uint8_t> grown(const Image<std::uint8_t>& mask, int radius_px) {
  if (radius_px < 1) return mask;
  Image<std::uint8_t> result(mask.columns, mask.rows);
  cv::Mat target = mat_of(result);
  const cv::Size size(2 * radius_px + 1, 2 * radius_px + 1);
  cv::dilate(mat_of(mask), target, cv::getStructuringElement(cv::MORPH_ELLIPSE, size));
  return result;
}

std::vector<std::vector<Eigen::Vector2d>> outlines(const Image<std::uint8_t>& mask) {
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(mat_of(mask), contours, cv::RETR_LIST, cv::CHAIN_APPROX_NONE);
  std::vector<std::vector<Eigen::Vector2d>> polygons;
  for (const std::vector<cv::Point>& contour : contours) {
    std::vector<cv::Point> straight;
    cv::approxPolyDP(contour, straight, 0.5, true);
    if (straight.size() < 3) continue;
    std::vector<Eigen::Vector2d>& polygon = polygons.emplace_back();
    for (const cv::Point& point : straight) polygon.emplace_back(point.x, point.y);
  }
  return polygons;
}

double share_inside(const Image<std::uint8_t>& mask, const PixelSquare& square) {
  return static_cast<double>(cv::countNonZero(mat_of(mask)(rectangle(square)))) / rectangle(square).area();
}

SquareMatch best_match(const Image<float>& image, const Image<std::uint8_t>& mask, const PixelSquare& square,
                       const Image<float>& in, int reach_px) {
  const cv::Rect here = rectangle(square);
  const cv::Rect around =
      cv::Rect(here.x - reach_px, here.y - reach_px, here.width + 2 * reach_px, here.height + 2 * reach_px) &
      cv::Rect(0, 0, in.columns, in.rows);
  const cv::Mat compared = mat_of(mask)(here) != 0;
  cv::Scalar mean, deviation;
  cv::meanStdDev(mat_of(image)(here), mean, deviation, compared);
  if (deviation[0] == 0.0) return {};  // OpenCV would find it everywhere
  // With a mask, OpenCV squares the levels, and divides by no contrast, too; and it takes several times as long.
  const cv::Mat levels = mat_of(in)(around) - cv::mean(mat_of(in)(around));
  const bool is_whole = cv::countNonZero(compared) == here.area();
  cv::Mat correlation;
  cv::matchTemplate(levels, mat_of(image)(here), correlation, cv::TM_CCOEFF_NORMED, is_whole ? cv::Mat() : compared);
  correlation.setTo(0.0, ~(cv::abs(correlation) <= 1.001));
  SquareMatch match;
  const cv::Point middle(here.x - around.x, here.y - around.y);
  match.correlation_here = correlation.at<float>(middle);
  cv::Point best;
  cv::minMaxLoc(correlation, nullptr, &match.correlation_there, nullptr, &best);
  match.displacement_px = {best.x - middle.x, best.y - middle.y};
  const auto at = [&](int dx, int dy) { return correlation.at<float>(best.y + dy, best.x + dx); };
  if (best.x > 0 && best.x + 1 < correlation.cols) match.displacement_px.x() += top_of(at(-1, 0), at(0, 0), at(1, 0));
  if (best.y > 0 && best.y + 1 < correlation.rows) match.displacement_px.y() += top_of(at(0, -1), at(0, 0), at(0, 1));
  return match;
}

}  // namespace isoshift
