#include "registration/quality/consistency.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace isoshift {
namespace {

// All lengths at the isocenter.
constexpr double kPixelMm = 1.5;
constexpr double kTileMm = 40.0;
constexpr double kSearchMm = 12.0;
constexpr double kSmoothMm = 15.0;  // slower changes are scatter and hardening, not anatomy
constexpr double kMinField = 0.95;  // share of a tile that must lie in the field
constexpr double kMinCorrelation = 0.7;
constexpr double kMaxDisplacementMm = 2.0;
constexpr double kMinGain = 0.05;  // of correlation, by moving the tile

// Line integrals without their slow changes.
cv::Mat high_pass(const Image<float>& image, double smooth_px) {
  const cv::Mat whole(image.rows, image.columns, CV_32F, const_cast<float*>(image.pixels.data()));
  cv::Mat slow;
  cv::GaussianBlur(whole, slow, cv::Size(0, 0), smooth_px, smooth_px, cv::BORDER_REPLICATE);
  return whole - slow;
}

double field_share(const Image<std::uint8_t>& field, const cv::Rect& square) {
  const cv::Mat whole(field.rows, field.columns, CV_8U, const_cast<std::uint8_t*>(field.pixels.data()));
  return static_cast<double>(cv::countNonZero(whole(square))) / square.area();
}

// The top of a parabola through three values, from the middle one.
double top_of(float before, float at, float after) {
  const float curvature = before - 2.0F * at + after;
  return curvature < 0.0F ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0.0;
}

Tile matched(const cv::Mat& xray, const cv::Mat& drr, const cv::Rect& square, int reach) {
  const cv::Rect whole(0, 0, drr.cols, drr.rows);
  const cv::Rect around =
      cv::Rect(square.x - reach, square.y - reach, square.width + 2 * reach, square.height + 2 * reach) & whole;
  cv::Mat correlation;
  cv::matchTemplate(drr(around), xray(square), correlation, cv::TM_CCOEFF_NORMED);
  const cv::Point here(square.x - around.x, square.y - around.y);
  cv::Point best;
  double best_value = 0.0;
  cv::minMaxLoc(correlation, nullptr, &best_value, nullptr, &best);
  Tile tile{.correlation = correlation.at<float>(here), .best_correlation = best_value};
  tile.displacement_mm = {best.x - here.x, best.y - here.y};
  if (best.x > 0 && best.x + 1 < correlation.cols)
    tile.displacement_mm.x() += top_of(correlation.at<float>(best.y, best.x - 1), correlation.at<float>(best),
                                       correlation.at<float>(best.y, best.x + 1));
  if (best.y > 0 && best.y + 1 < correlation.rows)
    tile.displacement_mm.y() += top_of(correlation.at<float>(best.y - 1, best.x), correlation.at<float>(best),
                                       correlation.at<float>(best.y + 1, best.x));
  return tile;
}

}  // namespace

int ViewConsistency::with_signal() const { return static_cast<int>(std::ranges::count_if(tiles, &Tile::has_signal)); }

int ViewConsistency::disagreeing() const { return static_cast<int>(std::ranges::count_if(tiles, &Tile::disagrees)); }

std::vector<ViewConsistency> regional_consistency(const RendererPyramid& renderers, const FixedViews& fixed,
                                                  const Eigen::Isometry3d& room_from_patient) {
  std::vector<ViewConsistency> views;
  const std::vector<FixedImage> levels = fixed.reduced_to(kPixelMm, room_from_patient, 0.0);
  for (std::size_t n = 0; n < levels.size(); ++n) {
    const FixedImage& level = levels[n];
    const double factor = static_cast<double>(fixed.images[n].view.columns) / level.view.columns;
    const double px_per_mm = pixels_per_mm(level.view);
    const RenderResult rendered = renderers.with_voxels_up_to(kPixelMm).render(
        std::span(&level.view, 1), std::span(&room_from_patient, 1), PixelSet::all());
    const cv::Mat xray = high_pass(level.line_integral, kSmoothMm * px_per_mm);
    const cv::Mat drr = high_pass(image_of(level.view, rendered.line_integrals(0, 0)), kSmoothMm * px_per_mm);

    const int edge = std::max(4, static_cast<int>(std::lround(kTileMm * px_per_mm)));
    const int reach = std::max(2, static_cast<int>(std::lround(kSearchMm * px_per_mm)));
    ViewConsistency view;
    for (int y = 0; y + edge <= xray.rows; y += edge / 2)
      for (int x = 0; x + edge <= xray.cols; x += edge / 2) {
        const cv::Rect square(x, y, edge, edge);
        if (field_share(level.field, square) < kMinField) continue;
        Tile tile = matched(xray, drr, square, reach);
        tile.displacement_mm /= px_per_mm;
        tile.center_px = {factor * (x + 0.5 * edge), factor * (y + 0.5 * edge)};
        tile.width_px = factor * edge;
        tile.has_signal = tile.best_correlation >= kMinCorrelation;
        tile.disagrees = tile.has_signal && tile.displacement_mm.norm() > kMaxDisplacementMm &&
                         tile.best_correlation - tile.correlation > kMinGain;
        view.tiles.push_back(tile);
      }
    views.push_back(std::move(view));
  }
  return views;
}

}  // namespace isoshift
