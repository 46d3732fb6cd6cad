#include "registration/preprocess/small_field.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "base/median.h"
#include "geometry/linear_algebra.h"

namespace isoshift {
namespace {

constexpr double kLeastMm = 8.0, kMostMm = 45.0;  // across it
constexpr double kHaloMm = 10.0;                  // beyond its edge: so far leaf ends and the receptor spread its light
constexpr double kDark = 0.05;                    // of its brightness, farther off
constexpr double kLevelError = 0.1;               // what half its brightness may differ from half the beam, relatively
constexpr double kMiddleShare = 0.6;              // of a side, off its corners
constexpr double kMostScatterMm = 0.5;            // of the outline about a rectangle's sides or a circle
constexpr double kRoundShare = 0.85;  // of its rectangle that a field with round outline covers at most: pi / 4
constexpr int kRays = 180;

// The largest connected place that is brighter than `level`, without the holes in it.
cv::Mat largest_place(const cv::Mat& intensity, double level, cv::Rect& bounds) {
  const cv::Mat bright = intensity > level;
  std::vector<std::vector<cv::Point>> outlines;
  cv::findContours(bright, outlines, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  cv::Mat place(intensity.size(), CV_8U, cv::Scalar(0));
  if (outlines.empty()) return place;
  const auto largest = std::ranges::max_element(
      outlines, {}, [](const std::vector<cv::Point>& outline) { return cv::contourArea(outline); });
  bounds = cv::boundingRect(*largest);
  cv::drawContours(place, outlines, static_cast<int>(largest - outlines.begin()), cv::Scalar(255), cv::FILLED);
  return place;
}

// Of the place off its penumbra. What lies in the field, such as a ball, darkens it: more of it is brighter than half.
double brightness_of(const cv::Mat& intensity, const cv::Mat& place, const cv::Rect& bounds) {
  constexpr double kRim = 0.2, kQuantile = 0.7;
  const int rim = static_cast<int>(kRim * std::min(bounds.width, bounds.height));
  cv::Mat inner;
  cv::erode(place, inner, cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * rim + 1, 2 * rim + 1}));
  std::vector<double> values;
  for (int row = bounds.y; row < bounds.br().y; ++row)
    for (int column = bounds.x; column < bounds.br().x; ++column)
      if (inner.at<std::uint8_t>(row, column) != 0) values.push_back(intensity.at<float>(row, column));
  if (values.empty()) return 0.0;
  const auto brightness =
      values.begin() + static_cast<std::ptrdiff_t>(kQuantile * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, brightness);
  return *brightness;
}

// Whether the image is dark beyond `place` and its halo.
bool is_alone(const cv::Mat& intensity, const cv::Mat& place, double brightness, double mm) {
  const int reach = static_cast<int>(std::lround(kHaloMm / mm));
  cv::Mat around;
  cv::dilate(place, around, cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * reach + 1, 2 * reach + 1}));
  double brightest = 0.0;
  cv::minMaxLoc(intensity, nullptr, &brightest, nullptr, nullptr, around == 0);
  return brightest < kDark * brightness;
}

// Between pixels; positions count from the rim.
double value_at(const cv::Mat& image, const Eigen::Vector2d& at) {
  const double x = std::clamp(at.x() - 0.5, 0.0, image.cols - 1.001),
               y = std::clamp(at.y() - 0.5, 0.0, image.rows - 1.001);
  const int column = static_cast<int>(x), row = static_cast<int>(y);
  const double u = x - column, v = y - row;
  return (1.0 - v) * ((1.0 - u) * image.at<float>(row, column) + u * image.at<float>(row, column + 1)) +
         v * ((1.0 - u) * image.at<float>(row + 1, column) + u * image.at<float>(row + 1, column + 1));
}

// Where the image first reaches `level` on the way in, from all around.
std::vector<Eigen::Vector2d> outline_of(const cv::Mat& intensity, const Eigen::Vector2d& middle, double from_px,
                                        double level) {
  constexpr double kStepPx = 0.25;
  std::vector<Eigen::Vector2d> outline;
  for (int ray = 0; ray < kRays; ++ray) {
    const double angle = 2.0 * std::numbers::pi * ray / kRays;
    const Eigen::Vector2d direction(std::cos(angle), std::sin(angle));
    double before = value_at(intensity, middle + from_px * direction);
    for (int step = 1; step * kStepPx < from_px; ++step) {
      const double off = from_px - step * kStepPx;
      const double here = value_at(intensity, middle + off * direction);
      if (here >= level) {
        outline.emplace_back(middle + (off + kStepPx * (here - level) / std::max(here - before, 1e-9)) * direction);
        break;
      }
      before = here;
    }
  }
  return outline;
}

// A rectangle or a circle through an outline.
struct Shape {
  std::array<double, 4> sides{};
  double scatter_px = 0.0;  // of the outline about it: where it scatters most
};

double scatter(std::vector<double> off) {
  for (double& value : off) value = std::abs(value);
  return 1.48 * median(std::move(off));
}

Shape circle_through(const std::vector<Eigen::Vector2d>& outline) {
  // x^2 + y^2 = 2 a x + 2 b y + c, about the first point.
  Eigen::MatrixX3d design(outline.size(), 3);
  Eigen::VectorXd squares(outline.size());
  for (std::size_t n = 0; n < outline.size(); ++n) {
    const Eigen::Vector2d at = outline[n] - outline.front();
    const auto row = static_cast<Eigen::Index>(n);
    design.row(row) << 2.0 * at.x(), 2.0 * at.y(), 1.0;
    squares[row] = at.squaredNorm();
  }
  const Eigen::Vector3d solution = least_squares(design, squares);
  const Eigen::Vector2d middle = outline.front() + solution.head<2>();
  const double radius = std::sqrt(solution[2] + solution.head<2>().squaredNorm());
  std::vector<double> off;
  off.reserve(outline.size());
  for (const Eigen::Vector2d& at : outline) off.push_back((at - middle).norm() - radius);
  return {.sides = {middle.x() - radius, middle.x() + radius, middle.y() - radius, middle.y() + radius},
          .scatter_px = scatter(std::move(off))};
}

// Through the middles of the sides; nothing if a side has too few points.
std::optional<Shape> rectangle_through(const std::vector<Eigen::Vector2d>& outline) {
  constexpr std::size_t kLeastPoints = 8;
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& at : outline) box.extend(at);
  Shape shape;
  for (std::size_t side = 0; side < 4; ++side) {
    const int axis = side < 2 ? 0 : 1, along = 1 - axis;
    std::vector<double> places;
    for (const Eigen::Vector2d& at : outline) {
      const bool is_low = at[axis] < box.center()[axis];
      const bool is_near = std::abs(at[axis] - (is_low ? box.min() : box.max())[axis]) < 0.25 * box.sizes()[axis];
      if (is_near && is_low == (side % 2 == 0) &&
          std::abs(at[along] - box.center()[along]) < 0.5 * kMiddleShare * box.sizes()[along])
        places.push_back(at[axis]);
    }
    if (places.size() < kLeastPoints) return std::nullopt;
    shape.sides[side] = median(places);
    for (double& place : places) place -= shape.sides[side];
    shape.scatter_px = std::max(shape.scatter_px, scatter(std::move(places)));
  }
  return shape;
}

double area_of(const std::vector<Eigen::Vector2d>& outline) {
  double doubled = 0.0;
  for (std::size_t n = 0; n < outline.size(); ++n) {
    const Eigen::Vector2d &here = outline[n], &next = outline[(n + 1) % outline.size()];
    doubled += here.x() * next.y() - here.y() * next.x();
  }
  return 0.5 * std::abs(doubled);
}

bool is_round(const std::vector<Eigen::Vector2d>& outline) {
  Eigen::AlignedBox2d box;
  for (const Eigen::Vector2d& at : outline) box.extend(at);
  return area_of(outline) < kRoundShare * box.volume();
}

// The shape of the outline at a level.
std::optional<Shape> shape_of(const std::vector<Eigen::Vector2d>& outline, bool is_round) {
  if (outline.size() < kRays) return std::nullopt;
  return is_round ? circle_through(outline) : rectangle_through(outline);
}

}  // namespace

std::optional<SmallField> find_small_field(const UprightXray& xray) {
  if (!xray.has_scale) return std::nullopt;
  const double mm = xray.mm;
  cv::Rect bounds;
  cv::Mat place = largest_place(xray.intensity, 0.5, bounds);
  place = largest_place(xray.intensity, 0.5 * brightness_of(xray.intensity, place, bounds), bounds);
  const double brightness = brightness_of(xray.intensity, place, bounds);
  const int least = static_cast<int>(kLeastMm / mm), most = static_cast<int>(kMostMm / mm);
  if (std::min(bounds.width, bounds.height) < least || std::max(bounds.width, bounds.height) > most ||
      !is_alone(xray.intensity, place, brightness, mm))
    return std::nullopt;
  // Light that the rim cuts off has no outline.
  const int margin = static_cast<int>(std::lround(3.0 / mm));
  const cv::Rect about(bounds.x - margin, bounds.y - margin, bounds.width + 2 * margin, bounds.height + 2 * margin);
  if ((about & cv::Rect(cv::Point(), xray.valid.size())) != about || cv::countNonZero(xray.valid(about)) < about.area())
    return std::nullopt;

  const Eigen::Vector2d middle(bounds.x + 0.5 * bounds.width, bounds.y + 0.5 * bounds.height);
  const double from_px = 0.5 * std::hypot(bounds.width, bounds.height) + margin;
  const auto outline_at = [&](double share) { return outline_of(xray.intensity, middle, from_px, share * brightness); };
  const std::vector<Eigen::Vector2d> outline = outline_at(0.5);
  SmallField field{.is_round = is_round(outline)};
  const std::optional<Shape> shape = shape_of(outline, field.is_round);
  const std::optional<Shape> outer = shape_of(outline_at(0.5 * (1.0 - kLevelError)), field.is_round),
                             inner = shape_of(outline_at(0.5 * (1.0 + kLevelError)), field.is_round);
  if (!shape || !outer || !inner || shape->scatter_px * mm > kMostScatterMm) return std::nullopt;
  field.sides = shape->sides;
  for (std::size_t side = 0; side < 4; ++side)
    field.sigma_mm = std::max(field.sigma_mm, 0.5 * mm * std::abs(outer->sides[side] - inner->sides[side]));
  field.sigma_mm = std::hypot(field.sigma_mm, shape->scatter_px * mm);
  return field;
}

}  // namespace isoshift
