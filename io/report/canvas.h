#pragma once
// A surface for report pages (PDF), drawings (SVG) and pictures (PNG). Lengths are points from the upper left corner, y
// down; for a PNG they are pixels. Text is drawn as text, not as outlines, in any script.

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/image.h"
#include "io/objects/image_files.h"

namespace isoshift {

// Colors that stay apart for color-blind eyes and in gray (Okabe and Ito's set).
namespace color {
inline constexpr Rgb kBlack{0, 0, 0}, kWhite{255, 255, 255}, kGray{110, 110, 110}, kLightGray{225, 225, 225},
    kPaleGray{245, 245, 245}, kBlue{0, 114, 178}, kOrange{230, 159, 0}, kVermilion{213, 94, 0}, kYellow{255, 220, 0},
    kSkyBlue{86, 180, 233};
}  // namespace color

struct TextStyle {
  enum class Align { kLeft, kCenter, kRight };
  double size = 8.5;
  bool bold = false;
  Rgb color = color::kBlack;
  Align align = Align::kLeft;   // within `width`, else about the position
  std::optional<double> width;  // longer lines are wrapped
  bool one_line = false;        // longer lines are cut off with an ellipsis instead
};

struct LineStyle {
  Rgb color = color::kBlack;
  double width = 0.6;
  bool dashed = false;
};

class Canvas {
 public:
  enum class Kind { kPdf, kSvg, kPng };
  Canvas(Kind kind, double width, double height);
  ~Canvas();
  Canvas(const Canvas&) = delete;
  Canvas& operator=(const Canvas&) = delete;

  double width() const { return width_; }
  double height() const { return height_; }

  // Draws text with its upper edge at y. Returns its height.
  double text(double x, double y, std::string_view utf8, const TextStyle& style);
  double text_height(std::string_view utf8, const TextStyle& style);
  double text_width(std::string_view utf8, const TextStyle& style);

  void line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const LineStyle& style);
  void arrow(const Eigen::Vector2d& from, const Eigen::Vector2d& to, const LineStyle& style);
  void polygon(std::span<const Eigen::Vector2d> points, const LineStyle& style, bool closed = true);
  void circle(const Eigen::Vector2d& center, double radius, const LineStyle& style);
  void fill(double x, double y, double width, double height, Rgb color);
  void fill_polygon(std::span<const Eigen::Vector2d> points, Rgb color);

  // Draws an image into a rectangle, its pixels averaged where they are smaller than the canvas's.
  void image(double x, double y, double width, double height, const Image<Rgb>& image);

  // Everything drawn until end_clip() is cut off at the rectangle.
  void begin_clip(double x, double y, double width, double height);
  void end_clip();

  // Only for a PDF.
  void new_page();
  void describe(const std::string& title, const std::string& creator);

  // The bytes of the file. Nothing may be drawn afterwards. Throws Error if drawing has failed.
  std::string finish();

 private:
  struct Drawing;
  std::unique_ptr<Drawing> drawing_;
  double width_, height_;
};

// Makes text from files safe to show: valid UTF-8, on one line, without control characters.
std::string printable(std::string_view text);
// The same of every line of a text.
std::string printable_lines(std::string_view text);

}  // namespace isoshift
