#include "workflow/scout/scout_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "io/report/view_picture.h"
#include "workflow/register/view_pictures.h"

namespace isoshift {
namespace {

using Eigen::Vector2d;

constexpr int kMarginPx = 6;  // around what the CT covers
constexpr int kSquares = 8;   // of a checkerboard along its shorter edge

template <class T>
Image<T> part_of(const Image<T>& image, const PixelRectangle& part) {
  Image<T> result(part.last_column - part.first_column + 1, part.last_row - part.first_row + 1);
  for (int row = 0; row < result.rows; ++row)
    for (int column = 0; column < result.columns; ++column)
      result.at(column, row) = image.at(part.first_column + column, part.first_row + row);
  return result;
}

// Where the CT's corners are projected; the whole image where that is unknown.
PixelRectangle covered_by(std::span<const Eigen::Vector3d> corners_room_mm, const XrayView& view) {
  Vector2d least(view.columns, view.rows), most(0.0, 0.0);
  for (const Eigen::Vector3d& corner : corners_room_mm) {
    const auto pixel = view.project(corner);
    if (!pixel) return {0, 0, view.columns - 1, view.rows - 1};
    least = least.cwiseMin(*pixel);
    most = most.cwiseMax(*pixel);
  }
  const auto within = [](double pixel, int count) { return static_cast<int>(std::clamp(pixel, 0.0, count - 1.0)); };
  return {within(least.x() - kMarginPx, view.columns), within(least.y() - kMarginPx, view.rows),
          within(most.x() + kMarginPx, view.columns), within(most.y() + kMarginPx, view.rows)};
}

struct DrawnTile {
  std::string caption;
  Image<Rgb> pixels;
};

std::vector<DrawnTile> tiles_of(const ViewPicture& picture) {
  const int square = std::max(4, std::min(picture.xray.columns, picture.xray.rows) / kSquares);
  return {{"Scout", in_gray(picture.xray)},
          {"Scout and CT by turns, as found", checkerboard(picture.xray, picture.drr_found, square)},
          {"CT, where its files say", in_gray(picture.drr_planned)},
          {"CT, as found", in_gray(picture.drr_found)},
          {"Both, where the files say", overlay(picture.xray, picture.drr_planned)},
          {"Both, as found (green: CT)", overlay(picture.xray, picture.drr_found)},
          {"Scout less CT, where files say", difference(picture.xray, picture.drr_planned)},
          {"Scout less CT, as found", difference(picture.xray, picture.drr_found)}};
}

// A letter on its edge of a tile, readable on dark and on bright.
void draw_letter(Canvas& canvas, double x, double y, const std::string& text, double size, TextStyle::Align align) {
  const double thin = 0.06 * size;
  for (const auto& [dx, dy] : {std::pair(-thin, 0.0), {thin, 0.0}, {0.0, -thin}, {0.0, thin}})
    canvas.text(x + dx, y + dy, text, {.size = size, .bold = true, .color = color::kBlack, .align = align});
  canvas.text(x, y, text, {.size = size, .bold = true, .color = color::kWhite, .align = align});
}

void draw_directions(Canvas& canvas, double x, double y, double width, double height, double size,
                     const std::array<std::string, 4>& directions) {
  using enum TextStyle::Align;
  const double middle = y + 0.5 * height - 0.65 * size, inset = 0.3 * size;
  draw_letter(canvas, x + inset, middle, directions[0], size, kLeft);
  draw_letter(canvas, x + width - inset, middle, directions[1], size, kRight);
  draw_letter(canvas, x + 0.5 * width, y + 0.1 * size, directions[2], size, kCenter);
  draw_letter(canvas, x + 0.5 * width, y + height - 1.4 * size, directions[3], size, kCenter);
}

void draw_scale(Canvas& canvas, double x, double y, double units_per_mm, double size) {
  constexpr double kLengthMm = 50.0;
  const Vector2d from(x, y), to(x + kLengthMm * units_per_mm, y);
  canvas.line(from, to, {.color = color::kBlack, .width = 0.35 * size});
  canvas.line(from, to, {.color = color::kWhite, .width = 0.2 * size});
  draw_letter(canvas, x, y - 1.4 * size, fmt::format("{:.0f} mm", kLengthMm), 0.8 * size, TextStyle::Align::kLeft);
}

}  // namespace

ViewPicture scout_picture(const FixedImage& compared, Renderer& renderer, double pixel_mm,
                          const std::array<Eigen::Isometry3d, 2>& room_from_patient,
                          std::span<const Eigen::Vector3d> ct_corners_patient_mm) {
  const XrayView& view = compared.view;
  std::vector<Eigen::Vector3d> corners;
  corners.reserve(ct_corners_patient_mm.size());
  for (const Eigen::Vector3d& corner : ct_corners_patient_mm) corners.push_back(room_from_patient[0] * corner);
  const PixelRectangle part = covered_by(corners, view);
  const RenderResult drrs = renderer.render(std::span(&view, 1), room_from_patient, PixelSet::all());
  ViewPicture picture;
  put_grays(picture, part_of(compared.line_integral, part), part_of(image_of(view, drrs.line_integrals(0, 0)), part),
            part_of(image_of(view, drrs.line_integrals(1, 0)), part), part_of(compared.field, part));
  picture.isocenter_px = view.project(Eigen::Vector3d::Zero()).value() - Vector2d(part.first_column, part.first_row);
  picture.pixels_per_mm = 1.0 / pixel_mm;
  picture.directions = directions_at_edges(view, room_from_patient[0]);
  return picture;
}

Image<Rgb> checkerboard(const Image<std::uint8_t>& scout, const Image<std::uint8_t>& ct, int square_px) {
  Image<Rgb> result(scout.columns, scout.rows);
  for (int row = 0; row < scout.rows; ++row)
    for (int column = 0; column < scout.columns; ++column) {
      const bool is_scout = (row / square_px + column / square_px) % 2 == 0;
      const std::uint8_t gray = (is_scout ? scout : ct).at(column, row);
      result.at(column, row) = {gray, gray, gray};
    }
  return result;
}

Image<Rgb> difference(const Image<std::uint8_t>& scout, const Image<std::uint8_t>& ct) {
  Image<Rgb> result(scout.columns, scout.rows);
  for (std::size_t n = 0; n < result.pixels.size(); ++n) {
    const auto gray = static_cast<std::uint8_t>(std::clamp(128 + scout.pixels[n] - ct.pixels[n], 0, 255));
    result.pixels[n] = {gray, gray, gray};
  }
  return result;
}

double draw_scout(Canvas& canvas, double x, double y, double width, double most_height, const ViewPicture& picture,
                  double aspect) {
  const std::vector<DrawnTile> tiles = tiles_of(picture);
  const double high_by_wide = aspect * picture.xray.rows / picture.xray.columns;
  const double gap = 0.012 * width, caption = 0.021 * width;
  const auto width_of_tile = [&](int per_row) {
    const int rows = static_cast<int>(tiles.size()) / per_row;
    const double across = (width - (per_row - 1) * gap) / per_row;
    return std::min(across, (most_height / rows - caption - gap) / high_by_wide);
  };
  const int per_row = width_of_tile(2) >= width_of_tile(4) ? 2 : 4;
  const double tile = width_of_tile(per_row), height = high_by_wide * tile;
  const double letters = 0.07 * std::min(tile, height);
  for (std::size_t n = 0; n < tiles.size(); ++n) {
    const int row = static_cast<int>(n) / per_row, column = static_cast<int>(n) % per_row;
    const double left = x + column * (tile + gap), top = y + row * (caption + height + gap);
    canvas.text(left, top, tiles[n].caption, {.size = 0.7 * caption, .width = tile, .one_line = true});
    canvas.image(left, top + caption, tile, height, tiles[n].pixels);
    draw_directions(canvas, left, top + caption, tile, height, letters, picture.directions);
    if (n == 0)
      draw_scale(canvas, left + 0.03 * tile, top + caption + height - letters,
                 tile / picture.xray.columns * picture.pixels_per_mm, letters);
  }
  return (static_cast<double>(tiles.size()) / per_row) * (caption + height + gap);
}

}  // namespace isoshift
