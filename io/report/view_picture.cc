#include "io/report/view_picture.h"

#include <algorithm>
#include <cmath>

namespace isoshift {
namespace {

// The line integrals that are black and white.
struct Scale {
  double black, white;
};

// From black, 0, to white, 1.
double shade(const Scale& scale, double value) {
  return std::clamp((value - scale.black) / (scale.white - scale.black), 0.0, 1.0);
}

Scale scale_of(std::vector<float> values) {
  const auto at_share = [&](double share) {
    const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::ranges::nth_element(values, nth);
    return static_cast<double>(*nth);
  };
  const double black = at_share(0.01);
  return {.black = black, .white = std::max(at_share(0.995), black + 1e-6)};
}

std::vector<float> pixels_in_field(const Image<float>& image, const Image<std::uint8_t>& field) {
  std::vector<float> pixels;
  for (std::size_t n = 0; n < image.pixels.size(); ++n)
    if (field.pixels[n] != 0) pixels.push_back(image.pixels[n]);
  return pixels.empty() ? image.pixels : pixels;
}

// The X-ray's scale in terms of a DRR: slope * drr + offset. X-rays are hardened and scattered, DRRs are not; a
// straight line is enough for the eye.
struct Line {
  double slope, offset;
};

Line fitted_line(const std::vector<float>& x, const std::vector<float>& y) {
  const auto n = static_cast<double>(x.size());
  double sum_x = 0.0, sum_y = 0.0, sum_xx = 0.0, sum_xy = 0.0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    sum_x += x[i];
    sum_y += y[i];
    sum_xx += static_cast<double>(x[i]) * x[i];
    sum_xy += static_cast<double>(x[i]) * y[i];
  }
  const double variance = sum_xx - sum_x * sum_x / n;
  const double slope = variance > 0.0 ? std::max(0.0, (sum_xy - sum_x * sum_y / n) / variance) : 0.0;
  return {.slope = slope, .offset = (sum_y - slope * sum_x) / n};
}

Image<std::uint8_t> grays(const Image<float>& image, const Line& line, const Scale& scale,
                          const Image<std::uint8_t>& field) {
  constexpr double kDimmed = 0.35;
  Image<std::uint8_t> result(image.columns, image.rows);
  for (std::size_t n = 0; n < image.pixels.size(); ++n)
    result.pixels[n] = static_cast<std::uint8_t>(std::lround(255.0 * (field.pixels[n] != 0 ? 1.0 : kDimmed) *
                                                             shade(scale, line.slope * image.pixels[n] + line.offset)));
  return result;
}

}  // namespace

void put_grays(ViewPicture& picture, const Image<float>& xray, const Image<float>& drr_planned,
               const Image<float>& drr_found, const Image<std::uint8_t>& field) {
  const std::vector<float> in_field = pixels_in_field(xray, field);
  const Line as_is{.slope = 1.0, .offset = 0.0}, line = fitted_line(pixels_in_field(drr_found, field), in_field);
  const Scale scale = scale_of(in_field);
  picture.xray = grays(xray, as_is, scale, field);
  picture.drr_planned = grays(drr_planned, line, scale, field);
  picture.drr_found = grays(drr_found, line, scale, field);
}

GrayScale GrayScale::of(const Image<float>& line_integral, const Image<std::uint8_t>& field) {
  const Scale scale = scale_of(pixels_in_field(line_integral, field));
  GrayScale result;
  result.low_ = scale.black;
  result.high_ = scale.white;
  for (std::size_t n = 0; n < kSteps; ++n) result.grays_[n] = static_cast<std::uint8_t>(255 * n / (kSteps - 1));
  return result;
}

GrayScale GrayScale::like(const Image<float>& drr, const Image<std::uint8_t>& xray, const Image<std::uint8_t>& field) {
  std::vector<float> values = pixels_in_field(drr, field);
  std::vector<std::uint8_t> grays;
  for (std::size_t n = 0; n < xray.pixels.size(); ++n)
    if (field.pixels[n] != 0) grays.push_back(xray.pixels[n]);
  if (grays.empty()) grays = xray.pixels;
  std::ranges::sort(values);
  std::ranges::sort(grays);
  GrayScale result;
  result.low_ = values.front();
  result.high_ = std::max(values.back(), values.front() + 1e-6F);
  for (std::size_t n = 0; n < kSteps; ++n) {
    const auto value =
        static_cast<float>(result.low_ + (result.high_ - result.low_) * static_cast<double>(n) / (kSteps - 1));
    const auto darker = static_cast<std::size_t>(std::ranges::upper_bound(values, value) - values.begin());
    result.grays_[n] = grays[std::min(darker, grays.size() - 1)];
  }
  return result;
}

Image<std::uint8_t> GrayScale::operator()(const Image<float>& line_integral) const {
  Image<std::uint8_t> picture(line_integral.columns, line_integral.rows);
  const double steps_per_unit = (kSteps - 1) / (high_ - low_);
  std::ranges::transform(line_integral.pixels, picture.pixels.begin(), [&](float value) {
    const double step = std::clamp((value - low_) * steps_per_unit, 0.0, static_cast<double>(kSteps - 1));
    return grays_[static_cast<std::size_t>(std::lround(step))];
  });
  return picture;
}

Image<std::uint8_t> radiograph(const Image<float>& line_integral) {
  const Image<std::uint8_t> everywhere(line_integral.columns, line_integral.rows, 1);
  return grays(line_integral, {.slope = 1.0, .offset = 0.0}, scale_of(line_integral.pixels), everywhere);
}

Image<std::array<std::uint8_t, 3>> in_gray(const Image<std::uint8_t>& picture) { return overlay(picture, picture); }

Image<std::array<std::uint8_t, 3>> overlay(const Image<std::uint8_t>& xray, const Image<std::uint8_t>& drr) {
  Image<std::array<std::uint8_t, 3>> result(xray.columns, xray.rows);
  for (std::size_t n = 0; n < xray.pixels.size(); ++n)
    result.pixels[n] = {xray.pixels[n], drr.pixels[n], xray.pixels[n]};
  return result;
}

std::string orientation_letters(const Eigen::Vector3d& direction_patient) {
  constexpr std::array kPositive = {'L', 'P', 'H'}, kNegative = {'R', 'A', 'F'};
  constexpr double kWeak = 0.3;
  const Eigen::Vector3d direction = direction_patient.normalized();
  std::array axes = {0, 1, 2};
  std::ranges::sort(axes, std::ranges::greater(), [&](int axis) { return std::abs(direction[axis]); });
  std::string letters;
  for (const int axis : axes)
    if (std::abs(direction[axis]) > kWeak)
      letters +=
          direction[axis] > 0.0 ? kPositive[static_cast<std::size_t>(axis)] : kNegative[static_cast<std::size_t>(axis)];
  return letters;
}

}  // namespace isoshift
