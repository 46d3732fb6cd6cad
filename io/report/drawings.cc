#include "io/report/drawings.h"
#include "io/report/view_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace isoshift {
namespace {

using Eigen::Vector2d;

Image<Rgb> pixels_of(const ViewPicture& picture, ViewTile tile) {
  switch (tile) {
    case ViewTile::kXray: return in_gray(picture.xray);
    case ViewTile::kDrrPlanned: return in_gray(picture.drr_planned);
    case ViewTile::kOverlayPlanned: return overlay(picture.xray, picture.drr_planned);
    case ViewTile::kDrrFound: return in_gray(picture.drr_found);
    case ViewTile::kOverlayFound: return overlay(picture.xray, picture.drr_found);
  }
  return {};
}

// Text on a picture, readable on dark and on bright.
void label(Canvas& canvas, double x, double y, const std::string& text, double size, Rgb color,
           TextStyle::Align align) {
  for (const auto& [dx, dy] : {std::pair(-0.4, 0.0), {0.4, 0.0}, {0.0, -0.4}, {0.0, 0.4}})
    canvas.text(x + dx, y + dy, text, {.size = size, .bold = true, .color = color::kBlack, .align = align});
  canvas.text(x, y, text, {.size = size, .bold = true, .color = color, .align = align});
}

void draw_isocenter(Canvas& canvas, const Vector2d& at, double reach) {
  for (const auto& style :
       {LineStyle{.color = color::kBlack, .width = 1.2}, LineStyle{.color = color::kYellow, .width = 0.6}})
    for (const Vector2d& along : {Vector2d(1, 0), Vector2d(-1, 0), Vector2d(0, 1), Vector2d(0, -1)})
      canvas.line(at + 0.35 * reach * along, at + reach * along, style);
}

// A bar of 50 mm at the isocenter, or of 10 where that is too long.
void draw_scale(Canvas& canvas, double x, double y, double points_per_mm, double width) {
  const double length_mm = 50.0 * points_per_mm < 0.4 * width ? 50.0 : 10.0;
  const Vector2d from(x, y), to(x + length_mm * points_per_mm, y);
  canvas.line(from, to, {.color = color::kBlack, .width = 2.0});
  canvas.line(from, to, {.color = color::kWhite, .width = 1.0});
  label(canvas, x, y - 0.075 * width, fmt::format("{:.0f} mm", length_mm), 0.05 * width, color::kWhite,
        TextStyle::Align::kLeft);
}

// The room seen from the foot of the couch: depth goes up and to the right.
struct RoomDrawing {
  double unit = 1.0;
  Vector2d origin;
  Vector2d at(double right, double toward, double up) const {
    return origin + unit * Vector2d(right + 0.42 * toward, -up - 0.30 * toward);
  }
};

void draw_table_and_patient(Canvas& canvas, const RoomDrawing& room, const SetupResult& report) {
  // The gantry, a ring behind, and the couch.
  canvas.circle(room.at(0, 1.0, 0), 0.78 * room.unit, {.color = color::kLightGray, .width = 0.16 * room.unit});
  // What lies on the support turns with it.
  const double yaw = report.table.yaw_rad(), cosine = std::cos(yaw), sine = std::sin(yaw);
  const auto on_table = [&](double right, double toward, double up) {
    return room.at(cosine * right - sine * toward, sine * right + cosine * toward, up);
  };
  const std::array<Vector2d, 4> top = {on_table(-0.34, -1.35, -0.2), on_table(0.34, -1.35, -0.2),
                                       on_table(0.34, 0.75, -0.2), on_table(-0.34, 0.75, -0.2)};
  const Vector2d thickness(0.0, 0.07 * room.unit);
  for (std::size_t n = 0; n < top.size(); ++n)
    canvas.fill_polygon(
        std::array<Vector2d, 4>{top[n], top[(n + 1) % 4], top[(n + 1) % 4] + thickness, top[n] + thickness},
        Rgb{170, 170, 170});
  canvas.fill_polygon(top, Rgb{205, 205, 205});
  // The patient: a body, and the head where it lies.
  const double head = report.patient_position.starts_with("HF") ? 1.0 : -1.0;
  Polygon body, skull;
  for (int n = 0; n < 24; ++n) {
    const double angle = 2.0 * M_PI * n / 24.0;
    body.push_back(on_table(0.2 * std::cos(angle), -0.35 * head + 0.62 * std::sin(angle), -0.12));
    skull.push_back(on_table(0.0, 0.42 * head, -0.1) + room.unit * 0.13 * Vector2d(std::cos(angle), std::sin(angle)));
  }
  for (const Polygon& part : {body, skull}) {
    canvas.fill_polygon(part, Rgb{235, 224, 206});
    canvas.polygon(part, {.color = color::kGray, .width = 0.5});
  }
}

void draw_couch_shift(Canvas& canvas, const RoomDrawing& room, const SetupResult& report, const ReportPage& page) {
  // Along the table top's axes at imaging; lengths of the arrows say nothing but which is longest.
  const Eigen::Matrix3d turn = rotation_z(report.table.yaw_rad());
  const std::array<Eigen::Vector3d, 3> directions = {turn.col(0), turn.col(1), Eigen::Vector3d::UnitZ()};
  const CouchShift shift = couch_shift_for(known_setup_error(report), report.table);
  const double longest = shift.translation_mm.cwiseAbs().maxCoeff();
  for (int n = 0; n < 3; ++n) {
    const Quantity& quantity = page.couch[static_cast<std::size_t>(n)];
    if (!quantity.is_number || quantity.words.empty()) continue;
    const double value = shift.translation_mm[n];
    const Eigen::Vector3d end =
        std::copysign(0.3 + 0.45 * std::abs(value) / longest, value) * directions[static_cast<std::size_t>(n)];
    const Vector2d tip = room.at(end.x(), end.y(), end.z()), from = room.at(0, 0, 0);
    canvas.arrow(from, tip, {.color = color::kVermilion, .width = 2.4});
    const Vector2d way = (tip - from).normalized();
    const std::string text = quantity.value.substr(quantity.value.find_first_of("0123456789")) + " " + quantity.unit;
    // Below a level arrow, beside the others.
    const bool is_level = std::abs(way.y()) < 0.3, is_steep = std::abs(way.x()) < 0.3;
    const double size = 0.14 * room.unit + 2.0;
    using enum TextStyle::Align;
    canvas.text(tip.x() + (is_level   ? 0.0
                           : is_steep ? 6.0
                                      : 4.0 * way.x()),
                tip.y() + (is_level         ? 5.0
                           : way.y() < -0.3 ? -0.3 * size
                                            : -1.2 * size),
                text,
                {.size = size,
                 .bold = true,
                 .color = color::kVermilion,
                 .align = is_level         ? kCenter
                          : way.x() < -0.3 ? kRight
                                           : kLeft});
  }
}

}  // namespace

Rgb verdict_color(Verdict verdict) {
  switch (verdict) {
    case Verdict::kAccepted: return color::kBlue;
    case Verdict::kReview: return color::kOrange;
    case Verdict::kRejected: return color::kVermilion;
  }
  return color::kBlack;
}

std::string caption_of(ViewTile tile) {
  switch (tile) {
    case ViewTile::kXray: return "X-ray";
    case ViewTile::kDrrPlanned: return "DRR, as planned";
    case ViewTile::kOverlayPlanned: return "Before: both";
    case ViewTile::kDrrFound: return "DRR, as found";
    case ViewTile::kOverlayFound: return "After: both";
  }
  return "";
}

MismatchMarks mismatch_marks(const SetupResult::View& view) {
  MismatchMarks marks;
  if (!view.picture.moved.empty()) return marks;  // of the whole patient; bodies say it better
  const double shrink = view.picture.xray.columns / static_cast<double>(view.columns);
  for (const ViewPart& part : view.match.consistency.parts) {
    if (!part.disagrees) continue;
    const double half = 0.25 * shrink * part.width_px;  // parts overlap by half
    const Vector2d center = shrink * part.center_px;
    marks.squares.push_back({center + Vector2d(-half, -half), center + Vector2d(half, -half),
                             center + Vector2d(half, half), center + Vector2d(-half, half)});
    marks.ways.push_back({center, center + part.displacement_mm * view.picture.pixels_per_mm});
  }
  return marks;
}

double draw_view_tile(Canvas& canvas, double x, double y, double width, const SetupResult::View& view, ViewTile tile) {
  const ViewPicture& picture = view.picture;
  const double zoom = width / picture.xray.columns, height = zoom * picture.xray.rows;
  const auto place = [&](const Vector2d& pixel) {
    return Vector2d(x + zoom * (pixel.x() + 0.5), y + zoom * (pixel.y() + 0.5));
  };
  const auto draw = [&](const std::vector<Polygon>& polygons, const LineStyle& style) {
    for (Polygon polygon : polygons) {
      std::ranges::transform(polygon, polygon.begin(), place);
      canvas.polygon(polygon, style);
    }
  };
  canvas.image(x, y, width, height, pixels_of(picture, tile));
  canvas.begin_clip(x, y, width, height);
  const double fine = width / 200.0;
  // A field that is not sure stands out.
  const Rgb field_color = view.match.field.is_sure() ? color::kSkyBlue : color::kVermilion;
  draw(picture.field, {.color = field_color, .width = fine, .dashed = true});
  const bool is_found = tile == ViewTile::kDrrFound || tile == ViewTile::kOverlayFound;
  if (tile != ViewTile::kXray)
    for (const ViewPicture::Outline& outline : picture.structures)
      draw(is_found ? outline.found : outline.planned, {.color = color::kOrange, .width = fine});
  if (tile == ViewTile::kOverlayFound)
    for (const auto& marks = mismatch_marks(view); const auto* polygons : {&marks.squares, &marks.ways, &picture.moved})
      draw(*polygons, {.color = color::kYellow, .width = fine});
  draw_isocenter(canvas, place(picture.isocenter_px), 0.05 * width);
  if (tile == ViewTile::kXray)
    draw_scale(canvas, x + 0.05 * width, y + 0.95 * height, zoom * picture.pixels_per_mm, width);
  const double letters = 0.065 * width;
  const auto& [left, right, up, down] = picture.directions;
  using enum TextStyle::Align;
  label(canvas, x + 0.02 * width, y + 0.5 * (height - 1.3 * letters), left, letters, color::kWhite, kLeft);
  label(canvas, x + 0.98 * width, y + 0.5 * (height - 1.3 * letters), right, letters, color::kWhite, kRight);
  label(canvas, x + 0.5 * width, y + 0.01 * width, up, letters, color::kWhite, kCenter);
  label(canvas, x + 0.5 * width, y + height - 1.4 * letters, down, letters, color::kWhite, kCenter);
  canvas.end_clip();
  return height;
}

double draw_view(Canvas& canvas, double x, double y, double width, const SetupResult::View& view) {
  const double gap = 0.006 * width, tile = (width - 4.0 * gap) / 5.0;
  const TextStyle style{.size = 0.0145 * width, .width = tile, .one_line = true};
  const double captions = 1.45 * style.size;
  double height = 0.0;
  for (std::size_t n = 0; n < kViewTiles.size(); ++n) {
    const double at = x + static_cast<double>(n) * (tile + gap);
    canvas.text(at, y, caption_of(kViewTiles[n]) + (n == 0 ? " " + printable(view.label) : ""), style);
    height = draw_view_tile(canvas, at, y + captions, tile, view, kViewTiles[n]);
  }
  return captions + height;
}

std::string captioned_png(const std::vector<CaptionedPicture>& pictures, int per_row) {
  constexpr double kTile = 380.0, kCaption = 22.0, kGap = 4.0;
  const int rows = (static_cast<int>(pictures.size()) + per_row - 1) / per_row;
  Canvas canvas(Canvas::Kind::kPng, per_row * (kTile + kGap) - kGap, rows * (kTile + kCaption + kGap) - kGap);
  for (std::size_t n = 0; n < pictures.size(); ++n) {
    const std::size_t column = n % static_cast<std::size_t>(per_row), row = n / static_cast<std::size_t>(per_row);
    const Image<Rgb>& picture = pictures[n].picture;
    const double x = static_cast<double>(column) * (kTile + kGap);
    const double y = static_cast<double>(row) * (kTile + kCaption + kGap);
    const double zoom = kTile / std::max(picture.columns, picture.rows);
    canvas.text(x + 6.0, y + 2.0, pictures[n].caption, {.size = 13.0});
    canvas.image(x, y + kCaption, zoom * picture.columns, zoom * picture.rows, picture);
  }
  return canvas.finish();
}

void draw_couch(Canvas& canvas, double x, double y, double width, double height, const SetupResult& report,
                const ReportPage& page) {
  const double unit = std::min(width / 2.9, height / 2.35);
  const RoomDrawing room{.unit = unit, .origin = Vector2d(x + 0.45 * width, y + 0.58 * height)};
  draw_table_and_patient(canvas, room, report);
  const LineStyle axis{.color = color::kGray, .width = 0.7};
  const TextStyle small{.size = 0.115 * unit + 2.0, .color = color::kGray};
  canvas.arrow(room.at(0, 0, 0), room.at(0.95, 0, 0), axis);
  canvas.text(room.at(0.97, 0, 0).x(), room.at(0.97, 0, 0.1).y(), "x right", small);
  canvas.arrow(room.at(0, 0, 0), room.at(0, 1.25, 0), axis);
  canvas.text(room.at(0, 1.27, 0).x() + 2, room.at(0, 1.27, 0.16).y(), "y to gantry", small);
  canvas.arrow(room.at(0, 0, 0), room.at(0, 0, 0.95), axis);
  canvas.text(room.at(0, 0, 0.97).x() - 2, room.at(0, 0, 1.16).y(), "z up", small);
  if (!page.withheld && page.couch.size() >= 3) draw_couch_shift(canvas, room, report, page);
}

void draw_convergence(Canvas& canvas, double x, double y, double width, double height,
                      const std::vector<StageReport>& stages) {
  std::size_t evaluations = 0;
  double low = 1.0, high = 0.0;
  for (const StageReport& stage : stages) {
    evaluations += stage.best.size();
    for (const double value : stage.best) {
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  if (evaluations < 2 || !(high > low)) return;
  constexpr double kLeft = 30.0, kBottom = 16.0, kTop = 12.0;
  const auto place = [&](double evaluation, double value) {
    return Vector2d(x + kLeft + (width - kLeft) * evaluation / static_cast<double>(evaluations - 1),
                    y + kTop + (height - kTop - kBottom) * (high - value) / (high - low));
  };
  const TextStyle small{.size = 7.0, .color = color::kGray};
  for (const double value : {low, high}) {
    canvas.line(place(0, value), place(static_cast<double>(evaluations - 1), value),
                {.color = color::kLightGray, .width = 0.5});
    canvas.text(x, place(0, value).y() - 4.5, fmt::format("{:.3f}", value), small);
  }
  canvas.text(x + 0.5 * (kLeft + width), y + height - kBottom + 3.0,
              fmt::format("{} evaluations; highest similarity so far in each stage", evaluations),
              {.size = 7.0, .color = color::kGray, .align = TextStyle::Align::kCenter});
  std::size_t done = 0;
  for (const StageReport& stage : stages) {
    if (stage.best.empty()) continue;
    const Vector2d begin = place(static_cast<double>(done), high);
    canvas.line({begin.x(), y + kTop}, {begin.x(), y + height - kBottom},
                {.color = color::kLightGray, .width = 0.5, .dashed = true});
    const std::string name = fmt::format("{}: {}", stage.name, stage.similarity);
    canvas.text(std::min(begin.x() + 2.0, x + width - canvas.text_width(name, small)), y, name, small);
    Polygon curve;
    for (std::size_t n = 0; n < stage.best.size(); ++n)
      curve.push_back(place(static_cast<double>(done + n), stage.best[n]));
    canvas.polygon(curve, {.color = color::kBlue, .width = 1.2}, false);
    done += stage.best.size();
  }
}

}  // namespace isoshift
