#pragma once
// What reports show as pictures: views, the couch with its axes, the course of the search.

#include <array>
#include <string>
#include <vector>

#include "io/report/canvas.h"
#include "io/report/report_page.h"

namespace isoshift {

// One of the pictures of a view.
enum class ViewTile { kXray, kDrrPlanned, kOverlayPlanned, kDrrFound, kOverlayFound };
inline constexpr std::array kViewTiles = {ViewTile::kXray, ViewTile::kDrrPlanned, ViewTile::kOverlayPlanned,
                                          ViewTile::kDrrFound, ViewTile::kOverlayFound};
std::string caption_of(ViewTile tile);

// The parts of a view that match elsewhere, in pixels of its picture: squares, and lines to where they match.
struct MismatchMarks {
  std::vector<Polygon> squares, ways;
};
MismatchMarks mismatch_marks(const SetupResult::View& view);

// Draws a tile of that width with its upper left corner at (x, y): the picture with isocenter, field and structures,
// scale bar and the patient's directions; in the overlay as found also squares where parts match elsewhere. Returns its
// height.
double draw_view_tile(Canvas& canvas, double x, double y, double width, const SetupResult::View& view, ViewTile tile);

// All tiles of a view side by side, each below its caption. Returns their height.
double draw_view(Canvas& canvas, double x, double y, double width, const SetupResult::View& view);

// Pictures in rows, each below its caption, as a PNG.
struct CaptionedPicture {
  std::string caption;
  Image<Rgb> picture;
};
std::string captioned_png(const std::vector<CaptionedPicture>& pictures, int per_row);

// Gantry, couch and patient seen by a person who faces the gantry, the axes of IEC 61217, and as arrows the
// translations to be made.
void draw_couch(Canvas& canvas, double x, double y, double width, double height, const SetupResult& report,
                const ReportPage& page);

// The similarity reached against the evaluations made, stage by stage.
void draw_convergence(Canvas& canvas, double x, double y, double width, double height,
                      const std::vector<StageReport>& stages);

}  // namespace isoshift
