#include "registration/preprocess/preprocess.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "base/error.h"
#include "base/parallel.h"
#include "registration/preprocess/irradiated_field.h"
#include "registration/preprocess/mat.h"

namespace isoshift {
namespace {

constexpr std::ptrdiff_t kFewestPixels = 150;  // 12 x 12, as few as a nearly closed collimator leaves
constexpr double kRimMm = 2.0;  // left out at the panel's rim and along the collimator's penumbra, at the isocenter

bool is_convex(const std::vector<Eigen::Vector2d>& polygon) {
  constexpr double kStraight = 1e-3;
  double least = 0.0, largest = 0.0;  // of the turns from side to side
  for (std::size_t n = 0; n < polygon.size(); ++n) {
    const Eigen::Vector2d here = polygon[(n + 1) % polygon.size()] - polygon[n],
                          next = polygon[(n + 2) % polygon.size()] - polygon[(n + 1) % polygon.size()];
    const double turn = here.x() * next.y() - here.y() * next.x();
    least = std::min(least, turn);
    largest = std::max(largest, turn);
  }
  return least > -kStraight || largest < kStraight;
}

// The pixels of a field that leaves make, which need not be convex.
Image<std::uint8_t> mask_of_leaves(const IrradiatedField& field, int columns, int rows, double rim_px) {
  constexpr int kFraction = 4;  // bits of a pixel's fraction
  std::vector<cv::Point> corners;
  corners.reserve(field.corners_px.size());
  for (const Eigen::Vector2d& corner : field.corners_px)
    corners.emplace_back(static_cast<int>(std::lround(corner.x() * (1 << kFraction))),
                         static_cast<int>(std::lround(corner.y() * (1 << kFraction))));
  // Drawn with a margin of one pixel: the panel's rim is a side, too.
  cv::Mat open(rows + 2, columns + 2, CV_8U, cv::Scalar(0)), distance;
  cv::fillPoly(open(cv::Rect(1, 1, columns, rows)), std::vector<std::vector<cv::Point>>{corners}, cv::Scalar(1),
               cv::LINE_8, kFraction);
  cv::distanceTransform(open, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  Image<std::uint8_t> mask(columns, rows, 0);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column)
      mask.at(column, row) = distance.at<float>(row + 1, column + 1) >= rim_px;
  return mask;
}

// The pixels of a field, a convex polygon but for leaves, that lie off its sides and off the panel's rim.
Image<std::uint8_t> mask_of(const IrradiatedField& field, int columns, int rows, double rim_px) {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  for (const Eigen::Vector2d& corner : field.corners_px)
    middle += corner / static_cast<double>(field.corners_px.size());
  std::vector<Eigen::Vector3d> sides;  // distance inside of (column, row, 1)
  if (!is_convex(field.corners_px)) return mask_of_leaves(field, columns, rows, rim_px);
  for (std::size_t n = 0; n < field.corners_px.size(); ++n) {
    const Eigen::Vector2d &here = field.corners_px[n], &next = field.corners_px[(n + 1) % field.corners_px.size()];
    if ((next - here).norm() < 1e-6) continue;
    Eigen::Vector2d normal = (next - here).unitOrthogonal();
    if (normal.dot(middle - here) < 0.0) normal = -normal;
    sides.emplace_back(normal.x(), normal.y(), -normal.dot(here));
  }
  Image<std::uint8_t> mask(columns, rows, 0);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      const bool off_rim = column >= rim_px && row >= rim_px && column < columns - rim_px && row < rows - rim_px;
      // The panel's own sides lie half a pixel beyond its pixels.
      mask.at(column, row) = off_rim && std::ranges::all_of(sides, [&](const Eigen::Vector3d& side) {
                               return side.x() * column + side.y() * row + side.z() + 0.5 >= rim_px;
                             });
    }
  return mask;
}

// Takes out of the field where most pixels lie at the least or the largest value: a receptor that saturated, or a
// display window, has cut them off, and their true values are not known. Single ones are noise, and stay.
void exclude_clipped(FixedImage& image) {
  const cv::Mat line_integral = mat_of(image.line_integral);
  cv::Mat field = mat_of(image.field);
  double least = 0.0, largest = 0.0;
  cv::minMaxLoc(line_integral, &least, &largest, nullptr, nullptr, field);
  for (const double extreme : {least, largest}) {
    cv::Mat clipped = line_integral == extreme;
    cv::medianBlur(clipped, clipped, 5);
    field.setTo(0, clipped);
  }
}

// Takes out of the field where there is no pixel, with a rim.
void exclude_padding(const Image<std::uint8_t>& padding, double rim_px, FixedImage& image) {
  cv::Mat distance;
  cv::distanceTransform(mat_of(padding) == 0, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  mat_of(image.field).setTo(0, distance < rim_px);
}

// What can be compared of an image at full resolution, by its irradiated field.
void put_field(FixedImage& image) {
  const double rim_px = std::max(1.0, (kRimMm + image.irradiated.keep_off_mm) * pixels_per_mm(image.view));
  image.field = mask_of(image.irradiated, image.view.columns, image.view.rows, rim_px);
  if (image.padding) exclude_padding(*image.padding, rim_px, image);
  exclude_clipped(image);
}

std::vector<Eigen::Vector2d> receptor_corners(const XrayView& view) {
  const double right = view.columns - 0.5, bottom = view.rows - 0.5;
  return {{-0.5, -0.5}, {right, -0.5}, {right, bottom}, {-0.5, bottom}};
}

// A watch, a plate or a marker with straight edges, as bright as nothing else, looks like a field. What it encloses is
// saturated, or next to nothing: then all of the receptor is compared, and a person must look.
void doubt_empty_field(FixedImage& image) {
  if (std::ranges::count(image.field.pixels, 1) >= kFewestPixels) return;
  image.irradiated = {.corners_px = receptor_corners(image.view),
                      .doubt =
                          "what the edges that were found enclose is saturated, or next to nothing: they may be an "
                          "object's (a watch, a plate)"};
  put_field(image);
}

}  // namespace

double pixels_per_mm(const XrayView& view) {
  const Eigen::Vector2d origin = view.project(Eigen::Vector3d::Zero()).value();
  const Eigen::Vector3d along = view.central_direction_room().unitOrthogonal();
  return (view.project(along).value() - origin).norm();
}

Image<float> line_integrals(const XrayImage& xray) {
  if (xray.meaning == XrayImage::Meaning::kLineIntegral) return xray.values;
  Image<float> result(xray.values.columns, xray.values.rows);
  const float brightest = *std::ranges::max_element(xray.values.pixels);
  // A dead or blocked pixel has no logarithm; a millionth of the maximum is below anything a receptor resolves.
  const float darkest = brightest * 1e-6F;
  std::ranges::transform(xray.values.pixels, result.pixels.begin(),
                         [&](float intensity) { return -std::log(std::max(intensity, darkest) / brightest); });
  return result;
}

FixedImage reduced(const FixedImage& image, int factor) {
  FixedImage result{.view = image.view.downscaled(factor),
                    .line_integral = Image<float>(image.view.columns / factor, image.view.rows / factor),
                    .field = Image<std::uint8_t>(image.view.columns / factor, image.view.rows / factor),
                    .irradiated = image.irradiated,
                    .label = image.label,
                    .reduced_by = image.reduced_by * factor};
  parallel_for(0, result.field.rows, [&](int row) {
    for (int column = 0; column < result.field.columns; ++column) {
      double sum = 0.0;
      bool inside = true;
      for (int r = row * factor; r < (row + 1) * factor; ++r)
        for (int c = column * factor; c < (column + 1) * factor; ++c) {
          sum += image.line_integral.at(c, r);
          inside = inside && image.field.at(c, r) != 0;
        }
      result.line_integral.at(column, row) = static_cast<float>(sum / (factor * factor));
      result.field.at(column, row) = inside;
    }
  });
  return result;
}

std::string name_of_view(std::string_view label, std::size_t index) {
  return label.empty() ? fmt::format("view {}", index + 1) : std::string(label);
}

void restrict_to(const PixelRectangle& rectangle, FixedImage& image) {
  // A person knows better than a field that is not sure.
  if (!image.irradiated.is_sure()) {
    image.irradiated = {.corners_px = receptor_corners(image.view)};
    put_field(image);
  }
  for (int row = 0; row < image.field.rows; ++row)
    for (int column = 0; column < image.field.columns; ++column)
      if (column < rectangle.first_column || column > rectangle.last_column || row < rectangle.first_row ||
          row > rectangle.last_row)
        image.field.at(column, row) = 0;
  const double left = rectangle.first_column - 0.5, right = rectangle.last_column + 0.5;
  const double top = rectangle.first_row - 0.5, bottom = rectangle.last_row + 0.5;
  image.irradiated = {.origin = IrradiatedField::Origin::kDrawn,
                      .corners_px = {{left, top}, {right, top}, {right, bottom}, {left, bottom}}};
}

std::vector<FixedImage> restricted_to(const RectanglesByLabel& rectangles, std::span<const FixedImage> images) {
  std::vector<FixedImage> restricted(images.begin(), images.end());
  for (FixedImage& image : restricted)
    if (const auto drawn = rectangles.find(image.label); drawn != rectangles.end()) restrict_to(drawn->second, image);
  return restricted;
}

FixedImage prepare(const XrayImage& xray) {
  const auto [darkest, brightest] = std::ranges::minmax(xray.values.pixels);
  const bool is_intensity = xray.meaning == XrayImage::Meaning::kIntensity;
  if (!(brightest > darkest) || (is_intensity && !(brightest > 0.0F)))
    throw Error(
        fmt::format("{}: the X-ray is blank: its {} run from {} to {} (check the pixel intensity relationship and its "
                    "sign)",
                    xray.label, is_intensity ? "intensities" : "line integrals", darkest, brightest));
  FixedImage image;
  image.view = xray.view;
  image.padding = xray.padding;
  image.label = xray.label;
  image.line_integral = line_integrals(xray);
  // The collimator of a line scan bounds no field: it shapes the fan.
  image.irradiated = xray.view.is_line_scan() ? IrradiatedField{.corners_px = receptor_corners(xray.view)}
                                              : find_irradiated_field(xray, pixels_per_mm(xray.view));
  put_field(image);
  if (image.irradiated.origin != IrradiatedField::Origin::kWholeReceptor) doubt_empty_field(image);
  return image;
}

std::vector<FixedImage> prepared(std::span<const XrayImage> xrays) {
  std::vector<FixedImage> images;
  for (const XrayImage& xray : xrays) images.push_back(prepare(xray));
  return images;
}

}  // namespace isoshift
