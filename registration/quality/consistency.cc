#include "registration/quality/consistency.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"
#include "registration/preprocess/image_operations.h"

namespace isoshift {
namespace {

// All lengths at the isocenter.
constexpr double kComparedPixelMm = 1.5;
constexpr double kTileMm = 40.0;
constexpr double kSearchMm = 12.0;
constexpr double kSmoothMm = 15.0;  // slower changes are scatter and hardening, not anatomy
constexpr double kMinField = 0.6;   // share of a tile that must lie in the field
constexpr double kMinCorrelation = 0.7;
constexpr double kMaxDisplacementMm = 2.0;
constexpr double kMinGain = 0.1;  // of correlation, by moving the tile

// The squares of a view that are checked: they overlap by half, and most of each lies in the field.
std::vector<PixelSquare> checked_squares(const Image<std::uint8_t>& field, int edge) {
  std::vector<PixelSquare> squares;
  for (int row = 0; row + edge <= field.rows; row += edge / 2)
    for (int column = 0; column + edge <= field.columns; column += edge / 2)
      if (const PixelSquare square{.column = column, .row = row, .edge = edge};
          share_inside(field, square) >= kMinField)
        squares.push_back(square);
  return squares;
}

ViewConsistency consistency_of(const FixedImage& level, std::span<const float> line_integrals) {
  const double px_per_mm = pixels_per_mm(level.view);
  const Image<float> xray = high_pass(level.line_integral, kSmoothMm * px_per_mm);
  const Image<float> drr = high_pass(image_of(level.view, line_integrals), kSmoothMm * px_per_mm);
  const int edge = std::max(4, static_cast<int>(std::lround(kTileMm * px_per_mm)));
  const int reach = std::max(2, static_cast<int>(std::lround(kSearchMm * px_per_mm)));
  const std::vector<PixelSquare> squares = checked_squares(level.field, edge);
  ViewConsistency view;
  view.parts.resize(squares.size());
  parallel_for(std::size_t{0}, squares.size(), [&](std::size_t n) {
    const PixelSquare& square = squares[n];
    const SquareMatch match = best_match(xray, level.field, square, drr, reach);
    const double factor = level.reduced_by;
    ViewPart& part = view.parts[n];
    part = {.center_px = (factor * Eigen::Vector2d(square.column + 0.5 * edge, square.row + 0.5 * edge)).array() - 0.5,
            .width_px = factor * edge,
            .displacement_mm = match.displacement_px / px_per_mm,
            .correlation = match.correlation_here,
            .best_correlation = match.correlation_there};
    part.has_signal = part.best_correlation >= kMinCorrelation;
    part.disagrees = part.has_signal && part.displacement_mm.norm() > kMaxDisplacementMm &&
                     part.best_correlation - part.correlation > kMinGain;
  });
  return view;
}

}  // namespace

std::vector<ViewConsistency> regional_consistency(const RendererPyramid& renderers, const FixedViews& fixed,
                                                  const Eigen::Isometry3d& room_from_patient) {
  const std::vector<FixedImage> levels = fixed.reduced_to(kComparedPixelMm, room_from_patient, 0.0);
  std::vector<XrayView> views;
  views.reserve(levels.size());
  for (const FixedImage& level : levels) views.push_back(level.view);
  const RenderResult drrs =
      renderers.with_voxels_up_to(kComparedPixelMm).render(views, std::span(&room_from_patient, 1), PixelSet::all());
  std::vector<ViewConsistency> consistency(levels.size());
  parallel_for(std::size_t{0}, levels.size(), [&](std::size_t view) {
    consistency[view] = consistency_of(levels[view], drrs.line_integrals(0, view));
  });
  return consistency;
}

}  // namespace isoshift
