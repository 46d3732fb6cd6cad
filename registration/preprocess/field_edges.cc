#include "registration/preprocess/field_edges.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "geometry/rotation.h"
#include "registration/preprocess/mat.h"

namespace isoshift {
namespace {

constexpr double kPixelMm = 0.7;      // of the upright image: a third of a penumbra
constexpr double kReachMm = 2.0;      // the step across an edge is measured from so far before it to so far behind it
constexpr double kAlongMm = 3.0;      // and averaged so far along it
constexpr float kFloor = 1e-3F;       // of the brightest intensity: darker is dark
constexpr float kStep = 0.35F;        // logarithm of the step that is as likely an edge as none: a factor of 1.4
constexpr float kRange = 6.0F;        // of the logarithms of an image, where it has no scale
constexpr double kMinSideMm = 12.0;   // the shortest side
constexpr double kNoEdge = 0.35;      // mean evidence of a side that says nothing for or against the field
constexpr double kMinEvidence = 0.3;  // of a side
constexpr int kMostCandidates = 16;   // per direction
constexpr double kCornerMm = 2.5;     // of a side, that the penumbra of the next one shades
constexpr double kNearMm = 3.0;       // jaws stand so near to where a file says
constexpr double kUnbroken = 0.75;    // mean evidence all the way from jaws to the leaves before them
constexpr double kJawsMm = 12.0;      // jaws stand no farther behind leaves, if the image darkens all the way
constexpr double kHalfEdgeMm = 3.0;   // from the inner end of an edge to where the logarithm falls most

// Steps of the logarithm from left to right.
cv::Mat steps_of(const UprightXray& xray) {
  const int along = 2 * static_cast<int>(std::lround(0.5 * kAlongMm / xray.mm)) + 1;
  const int reach = std::max(1, static_cast<int>(std::lround(kReachMm / xray.mm)));
  cv::Mat smooth, logarithm;
  cv::blur(xray.intensity, smooth, cv::Size(1, along), cv::Point(-1, -1), cv::BORDER_REPLICATE);
  smooth += kFloor;
  cv::log(smooth, logarithm);
  // Position x lies between pixels x - 1 and x.
  cv::Mat steps(xray.intensity.rows, xray.intensity.cols, CV_32F, cv::Scalar(0));
  for (int y = 0; y < steps.rows; ++y) {
    const auto* row = logarithm.ptr<float>(y);
    auto* step = steps.ptr<float>(y);
    for (int x = reach; x + reach <= steps.cols; ++x) step[x] = row[x + reach - 1] - row[x - reach];
  }
  return steps;
}

// Where steps_of() compares pixels that are both on the receptor.
cv::Mat compared_of(const UprightXray& xray) {
  const int reach = std::max(1, static_cast<int>(std::lround(kReachMm / xray.mm)));
  cv::Mat compared(xray.valid.rows, xray.valid.cols, CV_8U, cv::Scalar(0));
  for (int y = 0; y < compared.rows; ++y) {
    const auto* valid = xray.valid.ptr<std::uint8_t>(y);
    auto* both = compared.ptr<std::uint8_t>(y);
    for (int x = reach; x + reach <= compared.cols; ++x) both[x] = valid[x + reach - 1] & valid[x - reach];
  }
  return compared;
}

int corner_px(double mm) { return std::max(1, static_cast<int>(std::lround(kCornerMm / mm))); }

// From one of the other two sides to the other.
struct Span {
  int first, end;
  bool is_first_open, is_end_open;
};

// What a side adds to the score of a rectangle.
class SideScore {
 public:
  explicit SideScore(double mm) : mm_(mm), corner_(corner_px(mm)), beyond_(static_cast<int>(std::lround(15.0 / mm))) {}

  // Nothing where the side is no edge.
  std::optional<double> operator()(const EdgeMap& map, int at, bool is_open, const Span& span) const {
    if (is_open) return 0.0;
    const int first = span.first + (span.is_first_open ? 0 : corner_),
              end = span.end - (span.is_end_open ? 0 : corner_);
    if (end - first < 2) return std::nullopt;
    const double evidence = map.mean(at, first, end), length_mm = mm_ * map.compared_rows(at, first, end);
    if (evidence < kMinEvidence || length_mm < 0.6 * kMinSideMm) return std::nullopt;
    double score = length_mm * (evidence - kNoEdge);
    // The collimator's edge ends at the corner; a couch goes on.
    if (!span.is_first_open) score -= going_on(map, at, span.first - corner_ - beyond_, span.first - corner_);
    if (!span.is_end_open) score -= going_on(map, at, span.end + corner_, span.end + corner_ + beyond_);
    return score;
  }

 private:
  double going_on(const EdgeMap& map, int at, int first, int end) const {
    first = std::max(first, 0);
    end = std::min(end, map.rows());
    if (end - first < 2) return 0.0;
    return mm_ * map.compared_rows(at, first, end) * std::max(0.0, map.mean(at, first, end));
  }

  double mm_;
  int corner_, beyond_;
};

}  // namespace

UprightXray UprightXray::transposed() const {
  UprightXray result{.intensity = {}, .valid = {}, .has_scale = has_scale, .mm = mm, .from_image = from_image};
  cv::transpose(intensity, result.intensity);
  cv::transpose(valid, result.valid);
  return result;
}

UprightXray UprightXray::cropped(const cv::Rect& part) const {
  return {
      .intensity = intensity(part), .valid = valid(part), .has_scale = has_scale, .mm = mm, .from_image = from_image};
}

UprightXray upright_xray(const XrayImage& xray, double pixels_per_mm) {
  const int block = std::max(1, static_cast<int>(std::lround(kPixelMm * pixels_per_mm)));
  const cv::Mat values = mat_of(xray.values);
  cv::Mat reduced, smooth;
  cv::resize(values(cv::Rect(0, 0, values.cols / block * block, values.rows / block * block)), reduced, {}, 1.0 / block,
             1.0 / block, cv::INTER_AREA);
  double least = 0.0, largest = 0.0;
  cv::medianBlur(reduced, smooth, 3);
  cv::minMaxLoc(smooth, &least, &largest);
  UprightXray result;
  if (xray.meaning == XrayImage::Meaning::kIntensity) {
    result.intensity = cv::max(smooth, 0.0) / largest;
  } else {
    result.has_scale = false;
    cv::exp((least - smooth) * (kRange / std::max(largest - least, 1e-30)), result.intensity);
  }
  result.mm = block / pixels_per_mm;
  // Pixel n of the image lies at (n + 0.5) / block.
  result.from_image = cv::Matx23d(1.0 / block, 0, 0.5 / block, 0, 1.0 / block, 0.5 / block);
  result.valid = cv::Mat(result.intensity.size(), CV_8U, cv::Scalar(1));
  const double turn_rad = -std::remainder(xray.collimator_angle_rad, 0.5 * std::numbers::pi);
  if (std::abs(turn_rad) < rad_from_deg(0.1)) return result;

  const double c = std::cos(turn_rad), s = std::sin(turn_rad);  // as OpenCV turns: counter-clockwise as displayed
  const double width = result.intensity.cols, height = result.intensity.rows;
  const cv::Size size(static_cast<int>(std::ceil(width * std::abs(c) + height * std::abs(s))),
                      static_cast<int>(std::ceil(width * std::abs(s) + height * std::abs(c))));
  const cv::Matx23d turn(c, s, 0.5 * size.width - 0.5 * (c * width + s * height), -s, c,
                         0.5 * size.height - 0.5 * (-s * width + c * height));
  // For OpenCV pixel n lies at n, not at n + 0.5.
  cv::Matx23d for_opencv = turn;
  for (int row = 0; row < 2; ++row) for_opencv(row, 2) += 0.5 * (turn(row, 0) + turn(row, 1)) - 0.5;
  cv::warpAffine(result.intensity, result.intensity, for_opencv, size, cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  cv::warpAffine(result.valid, result.valid, for_opencv, size, cv::INTER_NEAREST, cv::BORDER_CONSTANT);
  cv::erode(result.valid, result.valid, cv::Mat(), cv::Point(-1, -1), 2, cv::BORDER_CONSTANT, 0);
  const cv::Matx23d f = result.from_image;
  result.from_image =
      cv::Matx23d(turn(0, 0) * f(0, 0), turn(0, 1) * f(1, 1), turn(0, 0) * f(0, 2) + turn(0, 1) * f(1, 2) + turn(0, 2),
                  turn(1, 0) * f(0, 0), turn(1, 1) * f(1, 1), turn(1, 0) * f(0, 2) + turn(1, 1) * f(1, 2) + turn(1, 2));
  return result;
}

EdgeMap::EdgeMap(const cv::Mat& steps, const cv::Mat& compared, int sign)
    : sums_(steps.rows + 1, steps.cols, CV_32F, cv::Scalar(0)),
      counts_(steps.rows + 1, steps.cols, CV_32F, cv::Scalar(0)) {
  for (int y = 0; y < steps.rows; ++y) {
    const auto* step = steps.ptr<float>(y);
    const auto* both = compared.ptr<std::uint8_t>(y);
    const auto *sum = sums_.ptr<float>(y), *count = counts_.ptr<float>(y);
    auto *next_sum = sums_.ptr<float>(y + 1), *next_count = counts_.ptr<float>(y + 1);
    const auto direction = static_cast<float>(sign);
    for (int x = 0; x < steps.cols; ++x) {
      const float is_compared = both[x];
      next_sum[x] = sum[x] + is_compared * std::clamp((direction * step[x] - kStep) / kStep, -1.0F, 1.0F);
      next_count[x] = count[x] + is_compared;
    }
  }
}

double EdgeMap::mean(int x, int first, int end) const {
  const float count = counts_.at<float>(end, x) - counts_.at<float>(first, x);
  return count > 0.0F ? (sums_.at<float>(end, x) - sums_.at<float>(first, x)) / count : -1.0;
}

int EdgeMap::compared_rows(int x, int first, int end) const {
  return static_cast<int>(counts_.at<float>(end, x) - counts_.at<float>(first, x));
}

std::vector<int> EdgeMap::candidates(int least_apart, double least_score, int most) const {
  // The best run of rows of every column: the largest difference between two of its sums.
  std::vector<float> best(static_cast<std::size_t>(columns()), 0.0F), lowest(best);
  for (int y = 1; y < sums_.rows; ++y) {
    const auto* sum = sums_.ptr<float>(y);
    for (std::size_t x = 0; x < best.size(); ++x) {
      best[x] = std::max(best[x], sum[x] - lowest[x]);
      lowest[x] = std::min(lowest[x], sum[x]);
    }
  }
  std::vector<int> found;
  std::vector<float> left = best;
  while (static_cast<int>(found.size()) < most) {
    const auto top = std::ranges::max_element(left);
    if (top == left.end() || *top < least_score) break;
    const int x = static_cast<int>(top - left.begin());
    // Not the flank of a candidate that was taken.
    const bool is_peak = (x == 0 || best[static_cast<std::size_t>(x) - 1] <= *top) &&
                         (x + 1 == columns() || best[static_cast<std::size_t>(x) + 1] <= *top);
    if (is_peak) {
      found.push_back(x);
      for (int near = std::max(0, x - least_apart); near <= std::min(columns() - 1, x + least_apart); ++near)
        left[static_cast<std::size_t>(near)] = 0.0F;
    } else {
      *top = 0.0F;
    }
  }
  return found;
}

FieldEdges::Axis FieldEdges::axis_of(const UprightXray& xray) {
  const cv::Mat steps = steps_of(xray), compared = compared_of(xray);
  Axis axis{.low = EdgeMap(steps, compared, 1),
            .high = EdgeMap(steps, compared, -1),
            .lows = {0},
            .highs = {steps.cols},
            .size = steps.cols};
  const int apart = static_cast<int>(std::lround(kReachMm / xray.mm));
  const double least = 0.5 * kMinSideMm / xray.mm;
  std::ranges::copy(axis.low.candidates(apart, least, kMostCandidates), std::back_inserter(axis.lows));
  std::ranges::copy(axis.high.candidates(apart, least, kMostCandidates), std::back_inserter(axis.highs));
  return axis;
}

FieldEdges::FieldEdges(const UprightXray& xray)
    : mm_(xray.mm), across_(axis_of(xray)), down_(axis_of(xray.transposed())) {}

FieldEdges::Place FieldEdges::place_of_edge(const EdgeMap& map, int at, int inward, int first, int end) const {
  const auto end_of = [&](int direction, double least, int most) {
    int place = at;
    while (std::abs(place - at) < most && place + direction >= 0 && place + direction < map.columns() &&
           map.mean(place + direction, first, end) >= least)
      place += direction;
    return place;
  };
  constexpr double kSame = 0.02;
  const double evidence = map.mean(at, first, end);
  const int most = static_cast<int>(std::lround(2.0 * kReachMm / mm_));
  const int middle = (end_of(-1, evidence - kSame, most) + end_of(1, evidence - kSame, most)) / 2;
  if (evidence < kUnbroken) return {middle};
  const int inner = end_of(inward, kUnbroken, static_cast<int>(std::lround(kJawsMm / mm_)));
  const int of_leaves = inner - inward * static_cast<int>(std::lround(kHalfEdgeMm / mm_));
  return inward * (of_leaves - middle) > 0 ? Place{of_leaves, true} : Place{middle};
}

FieldRectangle FieldEdges::with(int left, int right, int top, int bottom, double score) const {
  const int corner = corner_px(mm_), end = static_cast<int>(std::lround(12.0 / mm_));
  const auto side = [&](const EdgeMap& map, int at, int inward, bool is_open, int first, int last, int rim) {
    if (is_open) return FieldSide{.at = at};
    if (first > 0) first += corner;
    if (last < rim) last -= corner;
    if (last - first < 2) return FieldSide{.at = at, .is_open = false, .evidence = -1.0, .at_ends = -1.0};
    const Place place = place_of_edge(map, at, inward, first, last);
    return FieldSide{.at = place.at,
                     .is_open = false,
                     .evidence = map.mean(at, first, last),
                     .at_ends = std::min(map.mean(at, first, std::min(last, first + end)),
                                         map.mean(at, std::max(first, last - end), last)),
                     .has_slope = place.has_slope};
  };
  return {.sides = {side(across_.low, left, 1, left == 0, top, bottom, down_.size),
                    side(across_.high, right, -1, right == across_.size, top, bottom, down_.size),
                    side(down_.low, top, 1, top == 0, left, right, across_.size),
                    side(down_.high, bottom, -1, bottom == down_.size, left, right, across_.size)},
          .score = score};
}

FieldRectangle FieldEdges::best() const {
  const SideScore score_of(mm_);
  const int least = static_cast<int>(std::lround(kMinSideMm / mm_));
  FieldRectangle best = with(0, across_.size, 0, down_.size, 0.0);
  for (const int left : across_.lows)
    for (const int right : across_.highs) {
      if (right - left < least) continue;
      const Span columns{left, right, left == 0, right == across_.size};
      std::vector<std::optional<double>> of_bottoms;
      of_bottoms.reserve(down_.highs.size());
      for (const int bottom : down_.highs)
        of_bottoms.push_back(score_of(down_.high, bottom, bottom == down_.size, columns));
      for (const int top : down_.lows) {
        const std::optional<double> of_top = score_of(down_.low, top, top == 0, columns);
        for (std::size_t n = 0; of_top && n < of_bottoms.size(); ++n) {
          const int bottom = down_.highs[n];
          if (!of_bottoms[n] || bottom - top < least) continue;
          const Span rows{top, bottom, top == 0, bottom == down_.size};
          const auto of_left = score_of(across_.low, left, columns.is_first_open, rows);
          const auto of_right = score_of(across_.high, right, columns.is_end_open, rows);
          if (!of_left || !of_right) continue;
          const double score = *of_left + *of_right + *of_top + *of_bottoms[n];
          if (score > best.score) best = with(left, right, top, bottom, score);
        }
      }
    }
  return best;
}

FieldRectangle FieldEdges::near(const std::array<double, 4>& places) const {
  const int reach = static_cast<int>(std::lround(kNearMm / mm_));
  std::array<int, 4> at{};
  for (std::size_t n = 0; n < 4; ++n) {
    const Axis& axis = n < 2 ? across_ : down_;
    at[n] = std::clamp(static_cast<int>(std::lround(places[n])), 0, axis.size);
    const int margin = static_cast<int>(std::lround(kNearMm / mm_));
    if (at[n] <= margin || at[n] >= axis.size - margin) at[n] = n % 2 == 0 ? 0 : axis.size;
  }
  const std::array<int, 4> expected = at;
  for (std::size_t n = 0; n < 4; ++n) {
    const Axis& axis = n < 2 ? across_ : down_;
    if (expected[n] == 0 || expected[n] == axis.size) continue;
    const std::size_t across = n < 2 ? 2 : 0;
    const EdgeMap& map = n % 2 == 0 ? axis.low : axis.high;
    double best = -2.0;
    for (int place = expected[n] - reach; place <= expected[n] + reach; ++place) {
      const double evidence = map.mean(place, expected[across], expected[across + 1]);
      if (evidence > best) at[n] = place;
      best = std::max(best, evidence);
    }
  }
  return with(at[0], at[1], at[2], at[3], 0.0);
}

}  // namespace isoshift
