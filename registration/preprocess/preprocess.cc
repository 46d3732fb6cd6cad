#include "registration/preprocess/preprocess.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "base/error.h"
#include "geometry/rotation.h"
#include "registration/preprocess/mat.h"

namespace isoshift {
namespace {

constexpr double kRimMm = 2.0;  // left out at the panel's rim and along the collimator's penumbra, at the isocenter
constexpr double kPenumbraMm = 1.7;         // half the distance over which an edge must rise, at the isocenter
constexpr double kMinEdgeMm = 12.0;         // the shortest edge that counts, at the isocenter
constexpr float kMinEdgeContrast = 0.916F;  // ln 2.5, of an intensity image
constexpr float kMinEdgeShare = 0.15F;      // of the image's range, where line integrals come without a scale

// A straight run of rows along a column, across which the image brightens from left to right.
struct Edge {
  int column = 0;
  int first_row = 0;
  int rows = 0;
};

// The longest edge at a column: rows in which the line integral falls by `contrast` from x - reach to x + reach, gaps
// of two rows allowed.
Edge longest_edge_at(const cv::Mat& line_integral, int x, int reach, float contrast) {
  Edge longest{.column = x};
  int first_row = 0, gap = 0;
  bool running = false;
  for (int y = 0; y < line_integral.rows; ++y) {
    const auto* row = line_integral.ptr<float>(y);
    if (row[x - reach] - row[x + reach] > contrast) {
      if (!running) first_row = y;
      running = true;
      gap = 0;
      if (y + 1 - first_row > longest.rows) longest = {x, first_row, y + 1 - first_row};
    } else if (running && ++gap > 2) {
      running = false;
    }
  }
  return longest;
}

float median_of(const cv::Mat& part) {
  std::vector<float> values;
  values.reserve(part.total());
  for (int y = 0; y < part.rows; ++y) values.insert(values.end(), part.ptr<float>(y), part.ptr<float>(y) + part.cols);
  std::ranges::nth_element(values, values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2));
  return values[values.size() / 2];
}

// What edges are looked for, in pixels and in the units of the line integral.
struct EdgeSearch {
  int reach;     // half the penumbra
  int min_rows;  // the shortest edge that counts
  float contrast;
};

// The field's left side: the longest edge left of the isocenter, if the collimator shades all that lies beyond it. The
// patient's outline is bright on its outer side, and a metal rod is bright again on its other one. 0 where there is
// none.
int left_side(const cv::Mat& line_integral, double isocenter_column, const EdgeSearch& search) {
  const int end = std::min(static_cast<int>(isocenter_column), line_integral.cols - search.reach);
  std::vector<Edge> edges;
  for (int x = search.reach; x < end; ++x)
    edges.push_back(longest_edge_at(line_integral, x, search.reach, search.contrast));
  const auto longest = std::ranges::max_element(edges, {}, &Edge::rows);
  if (longest == edges.end() || longest->rows < search.min_rows) return 0;

  // Every column within the reach sees the same edge: its place is their middle.
  const auto sees_it = [&](const Edge& edge) { return edge.rows >= 0.9 * longest->rows; };
  auto first = longest, last = longest;
  while (first != edges.begin() && sees_it(*(first - 1))) --first;
  while (last + 1 != edges.end() && sees_it(*(last + 1))) ++last;
  const int side = (first->column + last->column) / 2;
  if (side - search.reach < 1) return 0;
  const cv::Mat rows = line_integral.rowRange(longest->first_row, longest->first_row + longest->rows);
  const float outside = median_of(rows.colRange(0, side - search.reach));
  const float inside = median_of(rows.colRange(side + search.reach, std::min(rows.cols, side + 8 * search.reach)));
  return outside - inside > search.contrast ? side : 0;
}

// The four sides, each found as the left side of the image mirrored or turned.
cv::Rect field_rectangle(const cv::Mat& line_integral, const cv::Point2d& isocenter, const EdgeSearch& search) {
  const int columns = line_integral.cols, rows = line_integral.rows;
  cv::Mat mirrored, turned, turned_and_mirrored;
  cv::flip(line_integral, mirrored, 1);
  cv::transpose(line_integral, turned);
  cv::flip(turned, turned_and_mirrored, 1);
  const int left = left_side(line_integral, isocenter.x, search);
  const int right = left_side(mirrored, columns - 1 - isocenter.x, search);
  const int top = left_side(turned, isocenter.y, search);
  const int bottom = left_side(turned_and_mirrored, rows - 1 - isocenter.y, search);
  return {left, top, columns - left - right, rows - top - bottom};
}

// The innermost field: behind the leaves there may be jaws, with an edge of their own.
cv::Rect innermost_field(const cv::Mat& line_integral, const cv::Point2d& isocenter, const EdgeSearch& search) {
  cv::Rect field(0, 0, line_integral.cols, line_integral.rows);
  for (;;) {
    const cv::Point2d offset(field.x, field.y);
    const cv::Rect inner = field_rectangle(line_integral(field), isocenter - offset, search);
    if (inner.size() == field.size()) return field;
    field = inner + field.tl();
  }
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

Image<std::uint8_t> irradiated_field(const XrayImage& xray, const Image<float>& line_integral) {
  const double scale = pixels_per_mm(xray.view);
  cv::Mat smooth;
  cv::medianBlur(mat_of(line_integral), smooth, 5);
  const auto [darkest, brightest] = std::ranges::minmax(line_integral.pixels);
  const EdgeSearch search{.reach = std::max(1, static_cast<int>(std::lround(kPenumbraMm * scale))),
                          .min_rows = std::max(3, static_cast<int>(std::lround(kMinEdgeMm * scale))),
                          .contrast = xray.meaning == XrayImage::Meaning::kIntensity
                                          ? kMinEdgeContrast
                                          : kMinEdgeShare * (brightest - darkest)};

  // Turn the image so that the collimator's edges are upright, find them, and turn the rectangle back.
  const double turn_deg = -deg_from_rad(std::remainder(xray.collimator_angle_rad, std::numbers::pi / 2.0));
  const cv::Size size = smooth.size();
  cv::Matx23d upright_from_image(1, 0, 0, 0, 1, 0);
  cv::Mat upright = smooth;
  if (std::abs(turn_deg) > 0.1) {
    const cv::Point2f center(0.5F * static_cast<float>(size.width - 1), 0.5F * static_cast<float>(size.height - 1));
    upright_from_image = cv::getRotationMatrix2D(center, turn_deg, 1.0);
    cv::warpAffine(smooth, upright, upright_from_image, size, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  }
  const Eigen::Vector2d isocenter = xray.view.project(Eigen::Vector3d::Zero()).value();
  const cv::Vec2d upright_isocenter = upright_from_image * cv::Vec3d(isocenter.x(), isocenter.y(), 1.0);
  const cv::Rect field = innermost_field(upright, {upright_isocenter[0], upright_isocenter[1]}, search);
  const double rim = std::max(1.0, kRimMm * scale);

  Image<std::uint8_t> mask(line_integral.columns, line_integral.rows, 0);
  const cv::Matx23d& m = upright_from_image;
  for (int row = 0; row < mask.rows; ++row)
    for (int column = 0; column < mask.columns; ++column) {
      const double x = m(0, 0) * column + m(0, 1) * row + m(0, 2);
      const double y = m(1, 0) * column + m(1, 1) * row + m(1, 2);
      // A side at the image's border is no edge of the field; only the panel's rim is left out there.
      const auto inside = [rim](double at, int begin, int end, int edge) {
        return (begin == 0 || at > begin + rim) && (end == edge || at < end - 1 - rim);
      };
      const bool off_rim = column >= rim && row >= rim && column < mask.columns - rim && row < mask.rows - rim;
      mask.at(column, row) = off_rim && inside(x, field.x, field.x + field.width, size.width) &&
                             inside(y, field.y, field.y + field.height, size.height);
    }
  return mask;
}

FixedImage reduced(const FixedImage& image, int factor) {
  FixedImage result{.view = image.view.downscaled(factor),
                    .line_integral = Image<float>(image.view.columns / factor, image.view.rows / factor),
                    .field = Image<std::uint8_t>(image.view.columns / factor, image.view.rows / factor),
                    .label = image.label,
                    .reduced_by = image.reduced_by * factor};
  for (int row = 0; row < result.field.rows; ++row)
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
  return result;
}

std::string name_of_view(std::string_view label, std::size_t index) {
  return label.empty() ? fmt::format("view {}", index + 1) : std::string(label);
}

void restrict_to(const PixelRectangle& rectangle, FixedImage& image) {
  for (int row = 0; row < image.field.rows; ++row)
    for (int column = 0; column < image.field.columns; ++column)
      if (column < rectangle.first_column || column > rectangle.last_column || row < rectangle.first_row ||
          row > rectangle.last_row)
        image.field.at(column, row) = 0;
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
  image.label = xray.label;
  image.line_integral = line_integrals(xray);
  image.field = irradiated_field(xray, image.line_integral);
  exclude_clipped(image);
  return image;
}

std::vector<FixedImage> prepared(std::span<const XrayImage> xrays) {
  std::vector<FixedImage> images;
  for (const XrayImage& xray : xrays) images.push_back(prepare(xray));
  return images;
}

}  // namespace isoshift
