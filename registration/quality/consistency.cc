#include "registration/quality/consistency.h"

#include <algorithm>
#include <cmath>

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

}  // namespace

std::vector<ViewConsistency> regional_consistency(const RendererPyramid& renderers, const FixedViews& fixed,
                                                  const Eigen::Isometry3d& room_from_patient) {
  std::vector<ViewConsistency> views;
  const std::vector<FixedImage> levels = fixed.reduced_to(kComparedPixelMm, room_from_patient, 0.0);
  for (std::size_t n = 0; n < levels.size(); ++n) {
    const FixedImage& level = levels[n];
    const double factor = level.reduced_by;
    const double px_per_mm = pixels_per_mm(level.view);
    const RenderResult rendered =
        renderers.with_voxels_up_to(kComparedPixelMm)
            .render(std::span(&level.view, 1), std::span(&room_from_patient, 1), PixelSet::all());
    const Image<float> xray = high_pass(level.line_integral, kSmoothMm * px_per_mm);
    const Image<float> drr = high_pass(image_of(level.view, rendered.line_integrals(0, 0)), kSmoothMm * px_per_mm);

    const int edge = std::max(4, static_cast<int>(std::lround(kTileMm * px_per_mm)));
    const int reach = std::max(2, static_cast<int>(std::lround(kSearchMm * px_per_mm)));
    ViewConsistency view;
    for (int row = 0; row + edge <= xray.rows; row += edge / 2)
      for (int column = 0; column + edge <= xray.columns; column += edge / 2) {
        const PixelSquare square{.column = column, .row = row, .edge = edge};
        if (share_inside(level.field, square) < kMinField) continue;
        const SquareMatch match = best_match(xray, level.field, square, drr, reach);
        ViewPart tile{.center_px = (factor * Eigen::Vector2d(column + 0.5 * edge, row + 0.5 * edge)).array() - 0.5,
                      .width_px = factor * edge,
                      .displacement_mm = match.displacement_px / px_per_mm,
                      .correlation = match.correlation_here,
                      .best_correlation = match.correlation_there};
        tile.has_signal = tile.best_correlation >= kMinCorrelation;
        tile.disagrees = tile.has_signal && tile.displacement_mm.norm() > kMaxDisplacementMm &&
                         tile.best_correlation - tile.correlation > kMinGain;
        view.parts.push_back(tile);
      }
    views.push_back(std::move(view));
  }
  return views;
}

}  // namespace isoshift
