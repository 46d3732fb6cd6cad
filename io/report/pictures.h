#pragma once
// Pictures a person judges a registration by.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "geometry/image.h"
#include "geometry/xray_view.h"
#include "io/image_files.h"

namespace isoshift {

// One view before and after: X-ray, DRR at the planned pose, DRR at the pose found, all as line integrals of the same
// size, and the field (1 inside) in which they were compared.
struct ViewComparison {
  // A part of the view that matches elsewhere: a square, and where to.
  struct Disagreement {
    Eigen::Vector2d center_px;
    double width_px = 0.0;
    Eigen::Vector2d displacement_px;
  };

  std::string label;
  const Image<float>& xray;
  const Image<std::uint8_t>& field;
  const Image<float>& drr_planned;
  const Image<float>& drr_found;
  Eigen::Vector2d isocenter_px;
  std::vector<Disagreement> disagreements;
};

// Two rows (planned, found) of X-ray, DRR and their overlay: X-ray magenta, DRR green, so that what matches is gray,
// for color-blind eyes too. The DRRs are brought to the X-ray's scale by one straight line, fitted in the field at the
// pose found; outside the field everything is dimmed. The cross marks the isocenter; in the overlay as found, squares
// mark parts that match elsewhere, and a line points there.
void write_comparison_png(const std::filesystem::path& path, const ViewComparison& comparison);

// Pictures side by side and below each other, a caption above each.
struct CaptionedPicture {
  std::string caption;
  Image<Rgb> picture;
};
void write_captioned_png(const std::filesystem::path& path, const std::vector<CaptionedPicture>& pictures, int per_row);

// An image of line integrals as radiographs are looked at: dense is bright. The second writes it.
Image<Rgb> radiograph(const Image<float>& line_integral);
void write_line_integral_png(const std::filesystem::path& path, const Image<float>& line_integral);

}  // namespace isoshift
