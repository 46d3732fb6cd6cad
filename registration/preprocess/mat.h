#pragma once
// Images as OpenCV sees them. For the sources of this folder only.

#include <cstdint>
#include <opencv2/core.hpp>

#include "geometry/image.h"

namespace isoshift {

// Shares the pixels. Those of a const image are not to be changed.
inline cv::Mat mat_of(const Image<float>& image) {
  return {image.rows, image.columns, CV_32F, const_cast<float*>(image.pixels.data())};
}
inline cv::Mat mat_of(const Image<std::uint8_t>& image) {
  return {image.rows, image.columns, CV_8U, const_cast<std::uint8_t*>(image.pixels.data())};
}

}  // namespace isoshift
