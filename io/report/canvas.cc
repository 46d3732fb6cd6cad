#include "io/report/canvas.h"

#include <cairo-pdf.h>
#include <cairo-svg.h>
#include <pango/pangocairo.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "base/error.h"
#include "base/utf8.h"

namespace isoshift {
namespace {

template <class T, auto end>
struct Deleter {
  void operator()(T* object) const { end(object); }
};
using Surface = std::unique_ptr<cairo_surface_t, Deleter<cairo_surface_t, cairo_surface_destroy>>;
using Context = std::unique_ptr<cairo_t, Deleter<cairo_t, cairo_destroy>>;
using Layout = std::unique_ptr<PangoLayout, Deleter<void, g_object_unref>>;
using Font = std::unique_ptr<PangoFontDescription, Deleter<PangoFontDescription, pango_font_description_free>>;

cairo_status_t append(void* bytes, const unsigned char* data, unsigned int size) {
  static_cast<std::string*>(bytes)->append(reinterpret_cast<const char*>(data), size);
  return CAIRO_STATUS_SUCCESS;
}

cairo_surface_t* surface_of(Canvas::Kind kind, double width, double height, std::string& bytes) {
  switch (kind) {
    case Canvas::Kind::kPdf: return cairo_pdf_surface_create_for_stream(append, &bytes, width, height);
    case Canvas::Kind::kSvg: return cairo_svg_surface_create_for_stream(append, &bytes, width, height);
    case Canvas::Kind::kPng:
      return cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(width), static_cast<int>(height));
  }
  return nullptr;
}

// Pango breaks long words in a time that grows with their square. No text that people write is as long as this.
std::string shortened(std::string_view utf8) {
  constexpr std::size_t kMostBytes = 2000;
  if (utf8.size() <= kMostBytes) return std::string(utf8);
  std::size_t end = kMostBytes;
  while (end > 0 && !begins_character(utf8[end])) --end;  // not within a character
  return std::string(utf8.substr(0, end)) + "…";
}

}  // namespace

struct Canvas::Drawing {
  Kind kind;
  std::string bytes;
  Surface surface;
  Context context;

  void color(Rgb rgb) const { cairo_set_source_rgb(context.get(), rgb[0] / 255.0, rgb[1] / 255.0, rgb[2] / 255.0); }

  void stroke(const LineStyle& style) const {
    constexpr std::array kDashes = {3.0, 2.0};
    color(style.color);
    cairo_set_line_width(context.get(), style.width);
    cairo_set_dash(context.get(), kDashes.data(), style.dashed ? static_cast<int>(kDashes.size()) : 0, 0.0);
    cairo_stroke(context.get());
  }

  void path(std::span<const Eigen::Vector2d> points) const {
    cairo_new_path(context.get());
    for (const Eigen::Vector2d& point : points) cairo_line_to(context.get(), point.x(), point.y());
  }

  Layout layout(std::string_view utf8, const TextStyle& style) const {
    Layout layout(pango_cairo_create_layout(context.get()));
    const Font font(pango_font_description_from_string(style.bold ? "DejaVu Sans, Noto Sans CJK JP Bold"
                                                                  : "DejaVu Sans, Noto Sans CJK JP"));
    pango_font_description_set_absolute_size(font.get(), style.size * PANGO_SCALE);
    pango_layout_set_font_description(layout.get(), font.get());
    const std::string shown = shortened(utf8);
    pango_layout_set_text(layout.get(), shown.data(), static_cast<int>(shown.size()));
    if (style.width) {
      pango_layout_set_width(layout.get(), static_cast<int>(*style.width * PANGO_SCALE));
      pango_layout_set_wrap(layout.get(), PANGO_WRAP_WORD_CHAR);
      if (style.one_line) pango_layout_set_ellipsize(layout.get(), PANGO_ELLIPSIZE_END);
      pango_layout_set_alignment(layout.get(), style.align == TextStyle::Align::kCenter  ? PANGO_ALIGN_CENTER
                                               : style.align == TextStyle::Align::kRight ? PANGO_ALIGN_RIGHT
                                                                                         : PANGO_ALIGN_LEFT);
    }
    return layout;
  }
};

Canvas::Canvas(Kind kind, double width, double height)
    : drawing_(std::make_unique<Drawing>()), width_(width), height_(height) {
  drawing_->kind = kind;
  drawing_->surface.reset(surface_of(kind, width, height, drawing_->bytes));
  drawing_->context.reset(cairo_create(drawing_->surface.get()));
  if (kind == Kind::kPng) fill(0, 0, width, height, color::kWhite);
}

Canvas::~Canvas() = default;

double Canvas::text(double x, double y, std::string_view utf8, const TextStyle& style) {
  const Layout layout = drawing_->layout(utf8, style);
  int width = 0, height = 0;
  pango_layout_get_size(layout.get(), &width, &height);
  const double share = style.width                                ? 0.0
                       : style.align == TextStyle::Align::kCenter ? 0.5
                       : style.align == TextStyle::Align::kRight  ? 1.0
                                                                  : 0.0;
  drawing_->color(style.color);
  cairo_move_to(drawing_->context.get(), x - share * width / PANGO_SCALE, y);
  pango_cairo_show_layout(drawing_->context.get(), layout.get());
  return static_cast<double>(height) / PANGO_SCALE;
}

double Canvas::text_height(std::string_view utf8, const TextStyle& style) {
  int height = 0;
  pango_layout_get_size(drawing_->layout(utf8, style).get(), nullptr, &height);
  return static_cast<double>(height) / PANGO_SCALE;
}

double Canvas::text_width(std::string_view utf8, const TextStyle& style) {
  int width = 0;
  pango_layout_get_size(drawing_->layout(utf8, style).get(), &width, nullptr);
  return static_cast<double>(width) / PANGO_SCALE;
}

void Canvas::line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const LineStyle& style) {
  const std::array points = {from, to};
  drawing_->path(points);
  drawing_->stroke(style);
}

void Canvas::arrow(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const LineStyle& style) {
  const Eigen::Vector2d along = (to - from).normalized(), across(-along.y(), along.x());
  const double head = 4.0 * style.width + 2.0;
  line(from, to - 0.8 * head * along, style);
  fill_polygon(std::array<Eigen::Vector2d, 3>{to, to - head * along + 0.45 * head * across,
                                              to - head * along - 0.45 * head * across},
               style.color);
}

void Canvas::polygon(std::span<const Eigen::Vector2d> points, const LineStyle& style, bool closed) {
  drawing_->path(points);
  if (closed) cairo_close_path(drawing_->context.get());
  drawing_->stroke(style);
}

void Canvas::circle(const Eigen::Vector2d& center, double radius, const LineStyle& style) {
  cairo_new_path(drawing_->context.get());
  cairo_arc(drawing_->context.get(), center.x(), center.y(), radius, 0.0, 2.0 * M_PI);
  drawing_->stroke(style);
}

void Canvas::fill(double x, double y, double width, double height, Rgb color) {
  drawing_->color(color);
  cairo_rectangle(drawing_->context.get(), x, y, width, height);
  cairo_fill(drawing_->context.get());
}

void Canvas::fill_polygon(std::span<const Eigen::Vector2d> points, Rgb color) {
  drawing_->path(points);
  drawing_->color(color);
  cairo_fill(drawing_->context.get());
}

void Canvas::image(double x, double y, double width, double height, const Image<Rgb>& image) {
  const Surface pixels(cairo_image_surface_create(CAIRO_FORMAT_RGB24, image.columns, image.rows));
  unsigned char* data = cairo_image_surface_get_data(pixels.get());
  const int stride = cairo_image_surface_get_stride(pixels.get());
  for (int row = 0; row < image.rows; ++row) {
    auto* out = reinterpret_cast<std::uint32_t*>(data + static_cast<std::ptrdiff_t>(row) * stride);
    for (int column = 0; column < image.columns; ++column) {
      const Rgb& rgb = image.at(column, row);
      out[column] = static_cast<std::uint32_t>(rgb[0]) << 16 | static_cast<std::uint32_t>(rgb[1]) << 8 | rgb[2];
    }
  }
  cairo_surface_mark_dirty(pixels.get());
  cairo_t* context = drawing_->context.get();
  cairo_save(context);
  cairo_translate(context, x, y);
  cairo_scale(context, width / image.columns, height / image.rows);
  cairo_set_source_surface(context, pixels.get(), 0, 0);
  cairo_pattern_set_filter(cairo_get_source(context), CAIRO_FILTER_GOOD);
  cairo_rectangle(context, 0, 0, image.columns, image.rows);
  cairo_fill(context);
  cairo_restore(context);
}

void Canvas::begin_clip(double x, double y, double width, double height) {
  cairo_save(drawing_->context.get());
  cairo_rectangle(drawing_->context.get(), x, y, width, height);
  cairo_clip(drawing_->context.get());
}

void Canvas::end_clip() { cairo_restore(drawing_->context.get()); }

void Canvas::new_page() { cairo_show_page(drawing_->context.get()); }

void Canvas::describe(const std::string& title, const std::string& creator) {
  cairo_pdf_surface_set_metadata(drawing_->surface.get(), CAIRO_PDF_METADATA_TITLE, title.c_str());
  cairo_pdf_surface_set_metadata(drawing_->surface.get(), CAIRO_PDF_METADATA_CREATOR, creator.c_str());
}

std::string Canvas::finish() {
  if (drawing_->kind == Kind::kPng)
    cairo_surface_write_to_png_stream(drawing_->surface.get(), append, &drawing_->bytes);
  const cairo_status_t drawn = cairo_status(drawing_->context.get());
  cairo_surface_finish(drawing_->surface.get());
  const cairo_status_t written = cairo_surface_status(drawing_->surface.get());
  for (const cairo_status_t status : {drawn, written})
    if (status != CAIRO_STATUS_SUCCESS)
      throw Error(std::string("the report cannot be drawn: ") + cairo_status_to_string(status));
  return std::move(drawing_->bytes);
}

std::string printable(std::string_view text) {
  const std::unique_ptr<char, Deleter<void, g_free>> valid(
      g_utf8_make_valid(text.data(), static_cast<gssize>(text.size())));
  std::string line;
  for (const char* at = valid.get(); *at != '\0'; at = g_utf8_next_char(at)) {
    const gunichar c = g_utf8_get_char(at);
    // Controls (C0, DEL, C1), ends of lines and paragraphs, and what turns the direction of the text around it.
    const bool is_control = c < 0x20 || (c >= 0x7F && c <= 0x9F) || c == 0x2028 || c == 0x2029 ||
                            (c >= 0x202A && c <= 0x202E) || (c >= 0x2066 && c <= 0x2069);
    if (is_control)
      line += ' ';
    else
      line.append(at, static_cast<std::size_t>(g_utf8_next_char(at) - at));
  }
  return line;
}

std::string printable_lines(std::string_view text) {
  std::string lines;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    lines += printable(text.substr(begin, end - begin)) + (end < text.size() ? "\n" : "");
    begin = end + 1;
  }
  return lines;
}

}  // namespace isoshift
