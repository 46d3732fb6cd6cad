#pragma once
// From X-ray pixels to what a DRR can be compared with. The only part of isoshift that uses OpenCV.

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/image.h"
#include "geometry/xray_image.h"
#include "setup/irradiated_field.h"

namespace isoshift {

// Pixels of a view per mm at the isocenter, across the central ray.
double pixels_per_mm(const XrayView& view);

// Line integrals -ln(I / I_max) of an intensity image, or the values of an image that holds line integrals already.
Image<float> line_integrals(const XrayImage& xray);

// One level of the pyramid: blocks of factor x factor pixels averaged over the field, and the blocks that lie wholly in
// it. What the receptor or a display window has cut off is not in the field.
struct FixedImage {
  XrayView view;
  Image<float> line_integral;
  Image<std::uint8_t> field;  // 1 where pixels can be compared: off the sides of the irradiated field and off the rim
  IrradiatedField irradiated;
  std::optional<Image<std::uint8_t>> padding;  // of the X-ray, at full resolution
  std::string label;                           // of the X-ray; may be empty
  int reduced_by = 1;                          // pixels of the X-ray along the edge of a pixel
  bool has_all_excluded = true;  // false: what is excluded would have left next to nothing, and is still in the field
};

// How view number `index` is called in what a person reads: by its label, else "view 1" and so on.
std::string name_of_view(std::string_view label, std::size_t index);

FixedImage reduced(const FixedImage& image, int factor);

// Columns and rows of an X-ray, bounds included.
struct PixelRectangle {
  int first_column = 0, first_row = 0, last_column = 0, last_row = 0;
};

// Takes out of the field, at full resolution, what lies outside a rectangle drawn by a person. A field that is not sure
// does not count: all of the receptor inside the rectangle is compared.
void restrict_to(const PixelRectangle& rectangle, FixedImage& image);
// Copies of images, each restricted to the rectangle of its label, if there is one.
using RectanglesByLabel = std::map<std::string, PixelRectangle>;
std::vector<FixedImage> restricted_to(const RectanglesByLabel& rectangles, std::span<const FixedImage> images);

// The whole way for one X-ray, at full resolution. Throws Error for a blank one.
FixedImage prepare(const XrayImage& xray);
std::vector<FixedImage> prepared(std::span<const XrayImage> xrays);

}  // namespace isoshift
