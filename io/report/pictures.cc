#include "io/report/pictures.h"

#include <cairo.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "io/image_files.h"

namespace isoshift {
namespace {

constexpr int kTilePx = 380;
constexpr int kCaptionPx = 22;
constexpr int kGapPx = 4;

// Gray value 0..1 of line integrals between the 1st and the 99.5th percentile.
struct Scale {
  double low = 0.0, high = 1.0;
  double operator()(double value) const { return std::clamp((value - low) / (high - low), 0.0, 1.0); }
};

Scale scale_of(std::vector<float> values) {
  const auto at_share = [&](double share) {
    const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::ranges::nth_element(values, nth);
    return static_cast<double>(*nth);
  };
  const double low = at_share(0.01);
  return {.low = low, .high = std::max(at_share(0.995), low + 1e-6)};
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

// Least squares over the field, at the pose found.
Line fitted_line(const ViewComparison& comparison) {
  const std::vector<float> x = pixels_in_field(comparison.drr_found, comparison.field);
  const std::vector<float> y = pixels_in_field(comparison.xray, comparison.field);
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

Image<float> brought_to_scale(Image<float> drr, const Line& line) {
  for (float& pixel : drr.pixels) pixel = static_cast<float>(line.slope * pixel + line.offset);
  return drr;
}

std::uint8_t byte(double share) { return static_cast<std::uint8_t>(std::lround(255.0 * share)); }

// Pastes an image, its red and blue from `first` and its green from `second`, zoomed to fit a tile.
void paste(Image<Rgb>& page, int x, int y, const Image<float>& first, const Image<float>& second, const Scale& scale,
           const Image<std::uint8_t>& field) {
  constexpr double kDimmed = 0.35;
  const double zoom = static_cast<double>(std::max(first.columns, first.rows)) / kTilePx;
  const int width = std::min(kTilePx, static_cast<int>(first.columns / zoom));
  const int height = std::min(kTilePx, static_cast<int>(first.rows / zoom));
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      const int c = std::min(first.columns - 1, static_cast<int>((column + 0.5) * zoom));
      const int r = std::min(first.rows - 1, static_cast<int>((row + 0.5) * zoom));
      const double brightness = field.at(c, r) != 0 ? 1.0 : kDimmed;
      const std::uint8_t magenta = byte(brightness * scale(first.at(c, r)));
      const std::uint8_t green = byte(brightness * scale(second.at(c, r)));
      page.at(x + column, y + row) = {magenta, green, magenta};
    }
}

// A cross whose middle stays free, in the yellow that stands out from gray and from magenta and green.
void mark(Image<Rgb>& page, int x, int y) {
  for (int d = 4; d < 12; ++d)
    for (const auto& [dx, dy] : {std::array{d, 0}, {-d, 0}, {0, d}, {0, -d}})
      if (x + dx >= 0 && x + dx < page.columns && y + dy >= 0 && y + dy < page.rows)
        page.at(x + dx, y + dy) = {255, 220, 0};
}

void put(Image<Rgb>& page, int x, int y) {
  if (x >= 0 && x < page.columns && y >= 0 && y < page.rows) page.at(x, y) = {255, 220, 0};
}

// The outline of a square about a point, and a line from there.
void mark_disagreement(Image<Rgb>& page, const Eigen::Vector2d& center, double width, const Eigen::Vector2d& way) {
  const int half = static_cast<int>(0.25 * width) - 1;  // parts overlap by half
  const int x = static_cast<int>(center.x()), y = static_cast<int>(center.y());
  for (int d = -half; d <= half; ++d) {
    put(page, x + d, y - half);
    put(page, x + d, y + half);
    put(page, x - half, y + d);
    put(page, x + half, y + d);
  }
  const int steps = std::max(1, static_cast<int>(way.lpNorm<Eigen::Infinity>()));
  for (int n = 0; n <= steps; ++n) {
    const Eigen::Vector2d at = center + way * n / steps;
    put(page, static_cast<int>(at.x()), static_cast<int>(at.y()));
  }
}

// Draws a line of text with cairo onto the page's own pixels.
void write_caption(Image<Rgb>& page, int x, int y, const std::string& text) {
  const std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)> surface(
      cairo_image_surface_create(CAIRO_FORMAT_RGB24, kTilePx, kCaptionPx), &cairo_surface_destroy);
  const std::unique_ptr<cairo_t, decltype(&cairo_destroy)> context(cairo_create(surface.get()), &cairo_destroy);
  cairo_set_source_rgb(context.get(), 1.0, 1.0, 1.0);
  cairo_select_font_face(context.get(), "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  cairo_set_font_size(context.get(), 13.0);
  cairo_move_to(context.get(), 6.0, 15.0);
  cairo_show_text(context.get(), text.c_str());
  cairo_surface_flush(surface.get());
  const unsigned char* data = cairo_image_surface_get_data(surface.get());
  if (data == nullptr) return;
  const int stride = cairo_image_surface_get_stride(surface.get());
  for (int row = 0; row < kCaptionPx; ++row)
    for (int column = 0; column < kTilePx; ++column) {
      const unsigned char gray = data[row * stride + column * 4];
      page.at(x + column, y + row) = {gray, gray, gray};
    }
}

}  // namespace

void write_comparison_png(const std::filesystem::path& path, const ViewComparison& comparison) {
  struct Row {
    Image<float> drr;
    const char* name;
  };
  const Line line = fitted_line(comparison);
  const std::array rows = {Row{brought_to_scale(comparison.drr_planned, line), "as planned"},
                           Row{brought_to_scale(comparison.drr_found, line), "as found"}};
  const Image<float>& xray = comparison.xray;
  const Scale scale = scale_of(pixels_in_field(xray, comparison.field));
  const double zoom = static_cast<double>(std::max(xray.columns, xray.rows)) / kTilePx;
  Image<Rgb> page(3 * kTilePx + 2 * kGapPx, 2 * (kTilePx + kCaptionPx) + kGapPx, Rgb{0, 0, 0});
  for (int n = 0; n < 2; ++n) {
    const Image<float>& drr = rows[n].drr;
    struct Tile {
      std::string caption;
      const Image<float>& first;
      const Image<float>& second;
    };
    const std::array tiles = {Tile{comparison.label + ": X-ray", xray, xray},
                              Tile{std::string("DRR, patient ") + rows[n].name, drr, drr},
                              Tile{std::string("overlay, ") + rows[n].name + " (gray where they match)", xray, drr}};
    for (int t = 0; t < 3; ++t) {
      const int x = t * (kTilePx + kGapPx);
      const int y = n * (kTilePx + kCaptionPx + kGapPx) + kCaptionPx;
      paste(page, x, y, tiles[t].first, tiles[t].second, scale, comparison.field);
      mark(page, x + static_cast<int>((comparison.isocenter_px.x() + 0.5) / zoom),
           y + static_cast<int>((comparison.isocenter_px.y() + 0.5) / zoom));
      write_caption(page, x, y - kCaptionPx, tiles[t].caption);
      if (n != 1 || t != 2) continue;
      for (const ViewComparison::Disagreement& part : comparison.disagreements)
        mark_disagreement(page, Eigen::Vector2d(x, y) + part.center_px / zoom, part.width_px / zoom,
                          part.displacement_px / zoom);
    }
  }
  write_png(path, page);
}

Image<Rgb> radiograph(const Image<float>& line_integral) {
  const Scale scale = scale_of(line_integral.pixels);
  Image<Rgb> picture(line_integral.columns, line_integral.rows);
  std::ranges::transform(line_integral.pixels, picture.pixels.begin(), [&](float value) {
    const std::uint8_t gray = byte(scale(value));
    return Rgb{gray, gray, gray};
  });
  return picture;
}

void write_line_integral_png(const std::filesystem::path& path, const Image<float>& line_integral) {
  write_png(path, radiograph(line_integral));
}

void write_captioned_png(const std::filesystem::path& path, const std::vector<CaptionedPicture>& pictures,
                         int per_row) {
  const int rows = (static_cast<int>(pictures.size()) + per_row - 1) / per_row;
  Image<Rgb> page(per_row * (kTilePx + kGapPx) - kGapPx, rows * (kTilePx + kCaptionPx + kGapPx) - kGapPx, Rgb{0, 0, 0});
  for (int n = 0; n < static_cast<int>(pictures.size()); ++n) {
    const int x = n % per_row * (kTilePx + kGapPx), y = n / per_row * (kTilePx + kCaptionPx + kGapPx);
    const Image<Rgb>& picture = pictures[static_cast<std::size_t>(n)].picture;
    write_caption(page, x, y, pictures[static_cast<std::size_t>(n)].caption);
    const double zoom = static_cast<double>(std::max(picture.columns, picture.rows)) / kTilePx;
    for (int row = 0; row < std::min(kTilePx, static_cast<int>(picture.rows / zoom)); ++row)
      for (int column = 0; column < std::min(kTilePx, static_cast<int>(picture.columns / zoom)); ++column)
        page.at(x + column, y + kCaptionPx + row) =
            picture.at(std::min(picture.columns - 1, static_cast<int>((column + 0.5) * zoom)),
                       std::min(picture.rows - 1, static_cast<int>((row + 0.5) * zoom)));
  }
  write_png(path, page);
}

}  // namespace isoshift
