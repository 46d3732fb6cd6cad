#include "registration/preprocess/preprocess.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "geometry/rotation.h"

namespace isoshift {
namespace {

constexpr double kRimMm = 2.0;             // left out at the panel's rim and along the collimator's penumbra, at the isocenter
constexpr double kPenumbraMm = 1.7;        // half the distance over which an edge must rise, at the isocenter
constexpr double kMinEdgeMm = 12.0;        // the shortest edge that counts, at the isocenter
constexpr float kMinEdgeContrast = 0.916F; // ln 2.5

// Pixels per mm at the isocenter.
double pixels_per_mm(const XrayView& view) {
  const Eigen::Vector2d origin = view.project(Eigen::Vector3d::Zero()).value();
  const Eigen::Vector3d along = view.central_direction_room().unitOrthogonal();
  return (view.project(along).value() - origin).norm();
}

cv::Mat as_mat(const Image<float>& image) {
  return {image.rows, image.columns, CV_32F, const_cast<float*>(image.pixels.data())};
}

// For every column x: the length of the longest run of rows, gaps of two pixels allowed, in which the line integral falls
// from x - reach to x + reach by the contrast of a collimator edge (it is dark left of x and bright right of it).
std::vector<int> edge_runs(const cv::Mat& line_integral, int reach) {
  std::vector<int> runs(line_integral.cols, 0);
  for (int x = reach; x + reach < line_integral.cols; ++x) {
    int run = 0, gap = 0;
    for (int y = 0; y < line_integral.rows; ++y) {
      const auto* row = line_integral.ptr<float>(y);
      if (row[x - reach] - row[x + reach] > kMinEdgeContrast) {
        run += gap + 1;
        gap = 0;
      } else if (++gap > 2) {
        run = gap = 0;
      }
      if (gap == 0) runs[x] = std::max(runs[x], run);
    }
  }
  return runs;
}

double median_of(cv::Mat part) {
  std::vector<float> values;
  values.reserve(part.total());
  for (int y = 0; y < part.rows; ++y) values.insert(values.end(), part.ptr<float>(y), part.ptr<float>(y) + part.cols);
  std::ranges::nth_element(values, values.begin() + values.size() / 2);
  return values[values.size() / 2];
}

// The field's left side: the column of the longest edge, if the collimator shades all that lies left of it. A metal rod
// has such edges too, but is bright again on its other side.
int left_side(const cv::Mat& line_integral, double pixels_per_mm) {
  const int reach = std::max(1, static_cast<int>(std::lround(kPenumbraMm * pixels_per_mm)));
  const std::vector<int> runs = edge_runs(line_integral, reach);
  const auto longest = std::ranges::max_element(runs);
  if (*longest < kMinEdgeMm * pixels_per_mm) return 0;
  // The edge fills the reach on both sides of its middle; take the middle of the columns that see nearly all of it.
  const auto first = std::ranges::find_if(runs, [&](int run) { return run >= 0.9 * *longest; });
  const auto last = std::find_if(runs.rbegin(), runs.rend(), [&](int run) { return run >= 0.9 * *longest; });
  const int begin = static_cast<int>(first - runs.begin());
  const int end = static_cast<int>(runs.rend() - last) - 1;
  if (end - begin > 4 * reach) return 0;  // edges far apart: not one straight edge
  const int side = (begin + end) / 2;
  if (side - reach < 1) return 0;
  const double outside = median_of(line_integral.colRange(0, side - reach));
  const double inside = median_of(line_integral.colRange(side + reach, std::min(line_integral.cols, side + 8 * reach)));
  return outside - inside > kMinEdgeContrast ? side : 0;
}

// The four sides, each found as the left side of a turned or mirrored image.
cv::Rect field_rectangle(const cv::Mat& line_integral, double pixels_per_mm) {
  const auto side_of = [&](auto&& turn) {
    cv::Mat turned;
    turn(turned);
    return left_side(turned, pixels_per_mm);
  };
  const int left = left_side(line_integral, pixels_per_mm);
  const int right = side_of([&](cv::Mat& out) { cv::flip(line_integral, out, 1); });
  const int top = side_of([&](cv::Mat& out) { cv::transpose(line_integral, out); });
  const int bottom = side_of([&](cv::Mat& out) {
    cv::Mat upside_down;
    cv::flip(line_integral, upside_down, 0);
    cv::transpose(upside_down, out);
  });
  return {left, top, std::max(0, line_integral.cols - left - right), std::max(0, line_integral.rows - top - bottom)};
}

}  // namespace

Image<float> line_integrals(const XrayImage& xray) {
  if (xray.meaning == XrayImage::Meaning::kLineIntegral) return xray.values;
  Image<float> result(xray.values.columns, xray.values.rows);
  const float brightest = *std::ranges::max_element(xray.values.pixels);
  if (!(brightest > 0.0F)) return result;
  // A dead or blocked pixel has no logarithm; a millionth of the maximum is below anything a receptor resolves.
  const float darkest = brightest * 1e-6F;
  std::ranges::transform(xray.values.pixels, result.pixels.begin(), [&](float intensity) {
    return -std::log(std::max(intensity, darkest) / brightest);
  });
  return result;
}

Image<std::uint8_t> irradiated_field(const XrayImage& xray, const Image<float>& line_integral) {
  const double scale = pixels_per_mm(xray.view);
  cv::Mat smooth;
  cv::medianBlur(as_mat(line_integral), smooth, 5);

  // Turn the image so that the collimator's edges are upright, find them, and turn the rectangle back.
  const double turn_deg = deg_from_rad(std::remainder(xray.collimator_angle_rad, std::numbers::pi / 2.0));
  const cv::Size size = smooth.size();
  cv::Matx23d upright_from_image(1, 0, 0, 0, 1, 0);
  cv::Mat upright = smooth;
  if (std::abs(turn_deg) > 0.1) {
    const cv::Point2f center(0.5F * static_cast<float>(size.width - 1), 0.5F * static_cast<float>(size.height - 1));
    upright_from_image = cv::getRotationMatrix2D(center, turn_deg, 1.0);
    cv::warpAffine(smooth, upright, upright_from_image, size, cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  }
  const cv::Rect field = field_rectangle(upright, scale);
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
                    .field = Image<std::uint8_t>(image.view.columns / factor, image.view.rows / factor)};
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

FixedImage prepare(const XrayImage& xray) {
  FixedImage image;
  image.view = xray.view;
  image.line_integral = line_integrals(xray);
  image.field = irradiated_field(xray, image.line_integral);
  return image;
}

}  // namespace isoshift
