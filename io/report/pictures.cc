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

// Gray value 0..1 between the 1st and 99.5th percentile.
class Scale {
 public:
  explicit Scale(const Image<float>& image) {
    std::vector<float> values = image.pixels;
    const auto at_share = [&](double share) {
      const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
      std::ranges::nth_element(values, nth);
      return *nth;
    };
    low_ = at_share(0.01);
    high_ = std::max(at_share(0.995), low_ + 1e-6F);
  }
  double operator()(float value) const { return std::clamp((value - low_) / (high_ - low_), 0.0F, 1.0F); }

 private:
  float low_, high_;
};

std::uint8_t byte(double share) { return static_cast<std::uint8_t>(std::lround(255.0 * share)); }

// Pastes an image, its red and blue from `first` and its green from `second`, scaled to fit a tile.
void paste(Image<Rgb>& page, int x, int y, const Image<float>& first, const Scale& first_scale,
           const Image<float>& second, const Scale& second_scale) {
  const double zoom = static_cast<double>(std::max(first.columns, first.rows)) / kTilePx;
  const int width = std::min(kTilePx, static_cast<int>(first.columns / zoom));
  const int height = std::min(kTilePx, static_cast<int>(first.rows / zoom));
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      const int c = std::min(first.columns - 1, static_cast<int>((column + 0.5) * zoom));
      const int r = std::min(first.rows - 1, static_cast<int>((row + 0.5) * zoom));
      const std::uint8_t magenta = byte(first_scale(first.at(c, r)));
      const std::uint8_t green = byte(second_scale(second.at(c, r)));
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
    const Image<float>& drr;
    const char* name;
  };
  const std::array rows = {Row{comparison.drr_planned, "as planned"}, Row{comparison.drr_found, "as found"}};
  Image<Rgb> page(3 * kTilePx + 2 * kGapPx, 2 * (kTilePx + kCaptionPx) + kGapPx, Rgb{0, 0, 0});
  const Scale xray_scale(comparison.xray);
  const double zoom = static_cast<double>(std::max(comparison.xray.columns, comparison.xray.rows)) / kTilePx;
  for (int n = 0; n < 2; ++n) {
    const Scale drr_scale(rows[n].drr);
    const int y = n * (kTilePx + kCaptionPx + kGapPx) + kCaptionPx;
    for (int tile = 0; tile < 3; ++tile) {
      const int x = tile * (kTilePx + kGapPx);
      const bool xray_first = tile != 1, xray_second = tile == 0;
      paste(page, x, y, xray_first ? comparison.xray : rows[n].drr, xray_first ? xray_scale : drr_scale,
            xray_second ? comparison.xray : rows[n].drr, xray_second ? xray_scale : drr_scale);
      mark(page, x + static_cast<int>((comparison.isocenter_px.x() + 0.5) / zoom),
           y + static_cast<int>((comparison.isocenter_px.y() + 0.5) / zoom));
      const std::string caption = tile == 0   ? comparison.label + "   X-ray"
                                  : tile == 1 ? std::string("DRR, patient ") + rows[n].name
                                              : std::string("overlay, ") + rows[n].name + "   (gray: they match)";
      write_caption(page, x, y - kCaptionPx, caption);
    }
  }
  write_png(path, page);
}

void write_line_integral_png(const std::filesystem::path& path, const Image<float>& line_integral) {
  const Scale scale(line_integral);
  Image<Rgb> picture(line_integral.columns, line_integral.rows);
  std::ranges::transform(line_integral.pixels, picture.pixels.begin(), [&](float value) {
    const std::uint8_t gray = byte(scale(value));
    return Rgb{gray, gray, gray};
  });
  write_png(path, picture);
}

}  // namespace isoshift
