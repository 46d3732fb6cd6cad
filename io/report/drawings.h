#pragma once
// The pictures of a report: views, the couch with its axes, the course of the search.

#include <array>
#include <string>
#include <vector>

#include "io/report/canvas.h"
#include "io/report/report_page.h"

namespace isoshift {

// In which a verdict is marked.
Rgb verdict_color(Verdict verdict);

// One of the pictures of a view.
enum class ViewTile { kXray, kDrrPlanned, kOverlayPlanned, kDrrFound, kOverlayFound };
inline constexpr std::array kViewTiles = {ViewTile::kXray, ViewTile::kDrrPlanned, ViewTile::kOverlayPlanned,
                                          ViewTile::kDrrFound, ViewTile::kOverlayFound};
std::string caption_of(ViewTile tile);

// The parts of a view that match elsewhere, in pixels of its picture: squares, and lines to the places where they
// match.
struct MismatchMarks {
  std::vector<Polygon> squares, ways;
};
MismatchMarks mismatch_marks(const SetupResult::View& view);

// Draws a tile of that width with its upper left corner at (x, y): the picture with isocenter, field, structures, scale
// bar and the patient's directions. The overlay at the pose found also marks the parts that match elsewhere or, of a
// bent patient, how bones moved. Returns the height of the tile.
double draw_view_tile(Canvas& canvas, double x, double y, double width, const SetupResult::View& view, ViewTile tile);

// Draws all tiles of a view side by side, each below its caption. Returns their height.
double draw_view(Canvas& canvas, double x, double y, double width, const SetupResult::View& view);

// Pictures in rows, each below its caption, as a PNG.
struct CaptionedPicture {
  std::string caption;
  Image<Rgb> picture;
};
std::string captioned_png(const std::vector<CaptionedPicture>& pictures, int per_row);

// Draws gantry, couch and patient as seen by a person who faces the gantry, with the axes of IEC 61217, and the
// translations of the couch shift as arrows.
void draw_couch(Canvas& canvas, double x, double y, double width, double height, const SetupResult& report,
                const ReportPage& page);

// Draws the similarity reached against the number of evaluations, stage by stage.
void draw_convergence(Canvas& canvas, double x, double y, double width, double height,
                      const std::vector<StageReport>& stages);

}  // namespace isoshift
