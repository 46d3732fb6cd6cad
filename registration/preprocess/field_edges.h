#pragma once
// Straight edges across which an image darkens, and the rectangle that they make. For the irradiated field only.

#include <array>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "geometry/xray_image.h"

namespace isoshift {

// An X-ray in blocks of pixels, turned so that the collimator's edges are upright. Positions are pixels of this image,
// whole numbers between pixels: 0 is the left rim.
struct UprightXray {
  cv::Mat intensity;       // in units of the brightest; of line integrals of unknown scale exp(-value), so scaled that
                           // the image's range is that of a usual image
  cv::Mat valid;           // 0: beyond the receptor
  bool has_scale = true;   // false: of line integrals of unknown scale
  double mm = 1.0;         // edge of a pixel at the isocenter
  cv::Matx23d from_image;  // of (column, row) of the X-ray

  UprightXray transposed() const;
  UprightXray cropped(const cv::Rect& part) const;  // `from_image` stays that of the whole
};

UprightXray upright_xray(const XrayImage& xray, double pixels_per_mm);

// How much the image darkens across straight lines: along every column, in one direction of x.
class EdgeMap {
 public:
  // Darkens toward smaller x (`sign` 1: left sides) or larger x (-1).
  EdgeMap(const cv::Mat& steps, const cv::Mat& compared, int sign);

  // Mean over rows [first, end) of how well there is an edge at x: 1 a clear one, 0 none can be told, -1 an opposite
  // one.
  double mean(int x, int first, int end) const;
  int compared_rows(int x, int first, int end) const;
  // Columns that hold a run of rows with an edge, the best first.
  std::vector<int> candidates(int least_apart, double least_score, int most) const;
  int columns() const { return sums_.cols; }
  int rows() const { return sums_.rows - 1; }

 private:
  cv::Mat sums_, counts_;  // over the rows above
};

struct FieldSide {
  int at = 0;              // pixels of the upright image; at the rim where the side is open
  bool is_open = true;     // no edge: the field reaches to the rim
  double evidence = 0.0;   // EdgeMap::mean() along it
  double at_ends = 0.0;    // the same along the 12 mm at one end, the lesser of the two
  bool has_slope = false;  // beyond it the image darkens all the way to another edge, as from leaves to jaws
};

// Left, right, top, bottom.
struct FieldRectangle {
  std::array<FieldSide, 4> sides;
  double score = 0.0;  // mm of side with an edge, less those without; 0: no side has one
};

// All edges of an image.
class FieldEdges {
 public:
  explicit FieldEdges(const UprightXray& xray);

  // The rectangle with the best score; the whole receptor where no edge helps.
  FieldRectangle best() const;
  FieldRectangle whole() const { return with(0, across_.size, 0, down_.size, 0.0); }
  // The rectangle whose sides are the clearest edges within 3 mm of these places. Places beyond the rim are open.
  FieldRectangle near(const std::array<double, 4>& places) const;

 private:
  struct Axis {  // a pair of opposite sides
    EdgeMap low, high;
    std::vector<int> lows, highs;  // candidates; the rim comes first
    int size;                      // of the image across
  };
  static Axis axis_of(const UprightXray& xray);
  // An edge is as clear at several places about its own: their middle. But the light beyond leaves falls all the way to
  // jaws that stand a few millimeters behind, whose edge is clear, too: the inner end of such a slope is the leaves'.
  struct Place {
    int at = 0;
    bool has_slope = false;
  };
  Place place_of_edge(const EdgeMap& map, int at, int inward, int first, int end) const;
  FieldRectangle with(int left, int right, int top, int bottom, double score) const;

  double mm_;
  Axis across_, down_;
};

}  // namespace isoshift
