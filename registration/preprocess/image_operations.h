#pragma once
// Neighborhoods of pixels: what OpenCV does for the rest of registration.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "geometry/image.h"

namespace isoshift {

// A square of pixels.
struct PixelSquare {
  int column = 0, row = 0, edge = 0;
};

// The image without its slow changes: less its Gaussian blur of this sigma.
Image<float> high_pass(const Image<float>& image, double sigma_px);

// A mask (not 0 inside) grown by a disc.
Image<std::uint8_t> grown(const Image<std::uint8_t>& mask, int radius_px);

// The edges of a mask's parts and of their holes, as closed polygons of pixels, straight to within half a pixel.
std::vector<std::vector<Eigen::Vector2d>> outlines(const Image<std::uint8_t>& mask);

// Share of a square that lies inside a mask.
double share_inside(const Image<std::uint8_t>& mask, const PixelSquare& square);

// Where a square of one image matches another of the same size best, within a search distance: by normalized cross
// correlation of its pixels inside a mask, to fractions of a pixel. A square without contrast matches nowhere:
// correlations of 0.
struct SquareMatch {
  Eigen::Vector2d displacement_px = Eigen::Vector2d::Zero();  // columns and rows, from the square to its match
  double correlation_here = 0.0, correlation_there = 0.0;
};
SquareMatch best_match(const Image<float>& image, const Image<std::uint8_t>& mask, const PixelSquare& square,
                       const Image<float>& in, int reach_px);

}  // namespace isoshift
