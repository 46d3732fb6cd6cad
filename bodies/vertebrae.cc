#include "bodies/vertebrae.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "base/median.h"
#include "base/parallel.h"
#include "bodies/disc_comb.h"
#include "bodies/lattice.h"
#include "bodies/spine_curve.h"
#include "bodies/spine_line.h"
#include "geometry/rotation.h"

namespace isoshift {
namespace {

constexpr float kOutsideHu = -1000.0F;

// Planes through a point of the curve, leaning to the front or back and to the sides.
constexpr std::array kLeanDegrees = {-16.0, -8.0, 0.0, 8.0, 16.0};

Eigen::Vector3d leaning(const CurveFrame& frame, int lean) {
  const int n = static_cast<int>(kLeanDegrees.size());
  return (frame.up + std::tan(rad_from_deg(kLeanDegrees[lean % n])) * frame.left +
          std::tan(rad_from_deg(kLeanDegrees[lean / n])) * frame.back)
      .normalized();
}

constexpr int kLeans = static_cast<int>(kLeanDegrees.size() * kLeanDegrees.size());

// Mean HU over a disc about a point, air and metal limited.
class DiscMean {
 public:
  explicit DiscMean(const Volume<float>& ct_hu) : ct_(ct_hu), voxel_from_patient_(ct_hu.patient_from_voxel.inverse()) {}

  // NaN where half of the disc or more lies outside the CT.
  float operator()(const Eigen::Vector3d& center_mm, const Eigen::Vector3d& up, double radius_mm) const {
    constexpr double kSpacingMm = 2.0;
    const Eigen::Vector3d left = Eigen::Vector3d::UnitY().cross(up).normalized(), back = up.cross(left);
    float sum = 0.0F;
    int count = 0, all = 0;
    const int steps = static_cast<int>(2.0 * radius_mm / kSpacingMm);
    for (int row = 0; row <= steps; ++row)
      for (int column = 0; column <= steps; ++column) {
        const double x = kSpacingMm * column - radius_mm, y = kSpacingMm * row - radius_mm;
        if (x * x + y * y > radius_mm * radius_mm) continue;
        ++all;
        const float hu = at(center_mm + x * left + y * back);
        if (hu == kOutsideHu) continue;
        sum += std::clamp(hu, -200.0F, 700.0F);
        ++count;
      }
    return 2 * count > all ? sum / static_cast<float>(count) : std::numeric_limits<float>::quiet_NaN();
  }
  float at(const Eigen::Vector3d& patient_mm) const {
    return interpolated(ct_, voxel_from_patient_ * patient_mm, kOutsideHu);
  }

 private:
  const Volume<float>& ct_;
  Eigen::Affine3d voxel_from_patient_;
};

constexpr double kProfileRadiusMm = 8.0;  // within the vertebral bodies of the neck, too

LeaningProfiles profiles_along(const DiscMean& mean, const SpineCurve& curve) {
  LeaningProfiles profiles(kLeans, std::vector<float>(curve.length()));
  parallel_for(0, curve.length(), [&](int s) {
    const CurveFrame frame = curve.frame(s);
    for (int lean = 0; lean < kLeans; ++lean)
      profiles[lean][s] = mean(frame.at_mm, leaning(frame, lean), kProfileRadiusMm);
  });
  return profiles;
}

// How far the vertebral body reaches from a point to the left, right, front and back, mm.
struct Reach {
  double left, right, front, back;
};

// Along a ray, the first edge at which the values drop at least half as much as they do anywhere: behind the posterior
// wall lies the canal, and behind that the arch, whose own edge is sharper.
std::optional<double> edge_mm(const std::vector<float>& along) {
  constexpr int kWindow = 4, kNearest = 6;
  constexpr double kLeastHu = 50.0;
  std::vector<double> drops(along.size(), 0.0);
  for (int r = kNearest; r + kWindow < static_cast<int>(along.size()); ++r)
    for (int n = 0; n < kWindow; ++n) drops[r] += (along[r - n] - along[r + 1 + n]) / kWindow;
  const double most = std::ranges::max(drops);
  if (most < kLeastHu) return std::nullopt;
  std::size_t r = 0;
  while (drops[r] < 0.5 * most) ++r;
  while (r + 1 < drops.size() && drops[r + 1] > drops[r]) ++r;
  return static_cast<double>(r) + 0.5;
}

std::optional<Reach> reach_of(const DiscMean& mean, const Eigen::Vector3d& center_mm, const CurveFrame& frame,
                              double half_height_mm) {
  constexpr int kFarthest = 34;
  const auto toward = [&](double x, double y) {
    std::vector<double> edges;
    for (const double turn_rad : {-0.45, -0.3, -0.15, 0.0, 0.15, 0.3, 0.45}) {
      const double c = std::cos(turn_rad), s = std::sin(turn_rad);
      const Eigen::Vector3d along = (c * x - s * y) * frame.left + (s * x + c * y) * frame.back;
      std::vector<float> values(kFarthest);
      for (int r = 0; r < kFarthest; ++r) {
        float sum = 0.0F;
        for (const double h : {-0.5, -0.25, 0.0, 0.25, 0.5})
          sum += std::clamp(mean.at(center_mm + r * along + h * half_height_mm * frame.up), -100.0F, 250.0F);
        values[r] = sum / 5.0F;
      }
      if (const auto edge = edge_mm(values)) edges.push_back(*edge * std::cos(turn_rad));
    }
    if (edges.size() < 3) return -1.0;
    return median(std::move(edges));
  };
  const Reach reach{toward(1, 0), toward(-1, 0), toward(0, -1), toward(0, 1)};
  if (reach.left < 0 || reach.right < 0 || reach.front < 0 || reach.back < 0) return std::nullopt;
  return reach;
}

// Where the middle of a vertebral body lies beside the curve, and its radius, mm.
struct Offset {
  double left = 0.0, back = 0.0, radius = 0.0;
  bool is_seen = false;
};

// Medians over each and its neighbors that were seen.
std::vector<Offset> agreed(const std::vector<Offset>& offsets, int reach) {
  std::vector<Offset> result = offsets;
  const int size = static_cast<int>(offsets.size());
  for (int n = 0; n < size; ++n) {
    std::vector<Offset> near;
    for (int m = std::max(0, n - reach); m <= std::min(size - 1, n + reach); ++m)
      if (offsets[m].is_seen) near.push_back(offsets[m]);
    if (near.empty()) continue;
    const auto median = [&](double Offset::* member) {
      std::vector<double> values;
      values.reserve(near.size());
      for (const Offset& offset : near) values.push_back(offset.*member);
      std::ranges::sort(values);
      return 0.5 * (values[(values.size() - 1) / 2] + values[values.size() / 2]);
    };
    result[n] = {median(&Offset::left), median(&Offset::back), median(&Offset::radius), true};
  }
  return result;
}

// The row of vertebrae while it grows: edges[n] and edges[n + 1] are those of the vertebra seen[n].
struct Row {
  std::vector<CombTooth> edges;
  std::vector<Offset> seen;
  bool first_is_cut = false, last_is_cut = false;
};

class RowFinder {
 public:
  RowFinder(const DiscMean& mean, const SpineCurve& curve, const std::vector<float>& profile)
      : mean_(mean), curve_(curve), profile_(profile) {}

  Row find(const std::vector<CombTooth>& discs) const {
    Row row{.edges = discs, .seen = {}};
    row.seen.resize(discs.size() - 1);
    parallel_for(std::size_t{0}, row.seen.size(),
                 [&](std::size_t n) { row.seen[n] = offset_between(discs[n].at, discs[n + 1].at, {}); });
    const double level_hu = 0.5 * median_between(discs);
    constexpr int kMostBeyond = 3;
    for (int n = 0; n < kMostBeyond && !row.first_is_cut; ++n)
      if (!extend(row, -1, level_hu)) break;
    for (int n = 0; n < kMostBeyond && !row.last_is_cut; ++n)
      if (!extend(row, 1, level_hu)) break;
    return row;
  }

 private:
  Offset offset_between(double from, double to, const Offset& start) const {
    const CurveFrame frame = curve_.frame(0.5 * (from + to));
    Offset offset = start;
    offset.is_seen = false;
    for (int pass = 0; pass < 2; ++pass) {
      const Eigen::Vector3d at = frame.at_mm + offset.left * frame.left + offset.back * frame.back;
      const auto reach = reach_of(mean_, at, frame, 0.5 * std::abs(to - from));
      if (!reach) return {};
      offset.left += 0.5 * (reach->left - reach->right);
      offset.back += 0.5 * (reach->back - reach->front);
      offset.radius = 0.25 * (reach->left + reach->right + reach->front + reach->back);
      offset.is_seen = true;
    }
    return offset;
  }

  double median_between(const std::vector<CombTooth>& discs) const {
    std::vector<float> inside;
    for (int s = discs.front().at; s < discs.back().at; ++s)
      if (!std::isnan(profile_[s])) inside.push_back(profile_[s]);
    return median(std::move(inside));
  }

  // How far bone goes on beyond a disc, up or down, mm; and whether it is the CT that ends.
  std::pair<int, bool> solid_mm(int from, int direction, int most_mm, double level_hu) const {
    constexpr int kDiscMm = 6;  // may be dark
    int reach = 0;
    for (int n = 1; n <= most_mm; ++n) {
      const int s = from + direction * n;
      if (s < 0 || s >= static_cast<int>(profile_.size()) || std::isnan(profile_[s])) return {reach, true};
      if (profile_[s] > level_hu)
        reach = n;
      else if (n > kDiscMm && n > reach + 2)
        break;
    }
    return {reach, false};
  }

  // Adds the vertebra above or below the row, as high as its neighbor, if there is bone, and if that looks like a
  // vertebral body as wide as the others or is cut off by the CT's end. Else the bone may be the skull.
  bool extend(Row& row, int direction, double level_hu) const {
    constexpr double kLeastShare = 0.25, kWholeShare = 0.8;
    const std::size_t n = row.edges.size();
    const int from = direction < 0 ? row.edges[0].at : row.edges[n - 1].at;
    const int spacing = direction < 0 ? row.edges[1].at - from : from - row.edges[n - 2].at;
    const auto [solid, ct_ends] = solid_mm(from, direction, spacing, level_hu);
    if (solid < kLeastShare * spacing) return false;
    const std::vector<Offset> near = agreed(row.seen, 2);
    const Offset& neighbor = direction < 0 ? near.front() : near.back();
    const int to = from + direction * spacing;
    // Only the half toward its neighbor: the topmost vertebra's other half may lie within the skull.
    const Offset found = offset_between(from, from + 0.5 * direction * spacing, neighbor);
    const bool is_alike = found.is_seen && neighbor.is_seen &&
                          std::abs(found.radius - neighbor.radius) < 0.3 * neighbor.radius &&
                          std::hypot(found.left - neighbor.left, found.back - neighbor.back) < 0.5 * neighbor.radius;
    if (!is_alike && !ct_ends) return false;
    const CombTooth edge{.at = to, .lean = kLeans / 2};
    row.edges.insert(direction < 0 ? row.edges.begin() : row.edges.end(), edge);
    row.seen.insert(direction < 0 ? row.seen.begin() : row.seen.end(), is_alike ? found : Offset());
    (direction < 0 ? row.first_is_cut : row.last_is_cut) = solid < kWholeShare * spacing;
    return true;
  }

  const DiscMean& mean_;
  const SpineCurve& curve_;
  const std::vector<float>& profile_;
};

// Where the body lies beside the curve, every 5 mm, whatever vertebra or disc is there.
constexpr int kSurveyMm = 5;
std::vector<Offset> survey(const DiscMean& mean, const SpineCurve& curve) {
  std::vector<Offset> offsets(curve.length() / kSurveyMm);
  parallel_for(std::size_t{0}, offsets.size(), [&](std::size_t n) {
    const double along = kSurveyMm * (static_cast<double>(n) + 0.5);
    if (along < SpineCurve::kBeyondMm || along > curve.length() - SpineCurve::kBeyondMm) return;
    const CurveFrame frame = curve.frame(along);
    constexpr double kHalfHeightMm = 5.0;
    if (const auto reach = reach_of(mean, frame.at_mm, frame, kHalfHeightMm))
      offsets[n] = {.left = 0.5 * (reach->left - reach->right),
                    .back = 0.5 * (reach->back - reach->front),
                    .radius = 0.25 * (reach->left + reach->right + reach->front + reach->back),
                    .is_seen = true};
  });
  return agreed(offsets, 4);
}

// The curve through the middle of what was surveyed, without its straight ends.
SpineCurve recentered(const SpineCurve& curve, const std::vector<Offset>& offsets) {
  std::vector<Eigen::Vector3d> points;
  for (std::size_t n = 0; n < offsets.size(); ++n) {
    const double along = kSurveyMm * (static_cast<double>(n) + 0.5);
    if (along < SpineCurve::kBeyondMm || along > curve.length() - SpineCurve::kBeyondMm) continue;
    const CurveFrame frame = curve.frame(along);
    points.emplace_back(frame.at_mm + offsets[n].left * frame.left + offsets[n].back * frame.back);
  }
  return points.size() < 2 ? curve : SpineCurve(points);
}

// Vertebrae with their discs are about 1.7 times as high as their bodies' radius, from the neck to the loin.
std::vector<double> expected_spacings(const std::vector<Offset>& offsets, int length) {
  constexpr double kHeightToRadius = 1.7;
  std::vector<double> spacings(length, 0.0);
  for (int s = 0; s < length; ++s) {
    const std::size_t n = std::min<std::size_t>(s / kSurveyMm, offsets.size() - 1);
    if (offsets[n].is_seen) spacings[s] = kHeightToRadius * offsets[n].radius;
  }
  return spacings;
}

std::vector<Vertebra> vertebrae_along(const Volume<float>& ct_hu, const Volume<float>& hu_on_patient_axes,
                                      SpineSigns signs) {
  const std::vector<Eigen::Vector3d> line_patient_mm = find_spine_line(hu_on_patient_axes, signs);
  if (line_patient_mm.size() < 2) return {};
  const DiscMean mean(ct_hu);
  const SpineCurve rough(line_patient_mm);
  const SpineCurve curve = recentered(rough, survey(mean, rough));
  const LeaningProfiles profiles = profiles_along(mean, curve);
  constexpr int kMargin = SpineCurve::kBeyondMm - 12;
  const std::vector<CombTooth> discs =
      find_discs(profiles, kMargin, curve.length() - kMargin, expected_spacings(survey(mean, curve), curve.length()));
  // Without an arch only what looks like discs tells a spine from any other bone.
  if (discs.size() < 2 || (signs == SpineSigns::kBodyAlone && !discs.front().is_dark)) return {};
  const Row row = RowFinder(mean, curve, profiles[kLeans / 2]).find(discs);
  const std::vector<Offset> offsets = agreed(row.seen, 2);
  std::vector<Vertebra> result;
  for (std::size_t n = 0; n < offsets.size(); ++n) {
    const CurveFrame frame = curve.frame(0.5 * (row.edges[n].at + row.edges[n + 1].at));
    const Eigen::Vector3d aside = offsets[n].left * frame.left + offsets[n].back * frame.back;
    const auto plane = [&](const CombTooth& tooth) {
      const CurveFrame at = curve.frame(tooth.at);
      return DiscPlane{at.at_mm + aside, leaning(at, tooth.lean)};
    };
    result.push_back({.center_patient_mm = frame.at_mm + aside,
                      .lower = plane(row.edges[n]),
                      .upper = plane(row.edges[n + 1]),
                      .radius_mm = offsets[n].radius,
                      .has_edges = row.seen[n].is_seen,
                      .is_cut = (n == 0 && row.first_is_cut) || (n + 1 == offsets.size() && row.last_is_cut)});
  }
  return result;
}

std::ptrdiff_t with_edges(const std::vector<Vertebra>& vertebrae) {
  return std::ranges::count_if(vertebrae, [](const Vertebra& vertebra) { return vertebra.has_edges; });
}

}  // namespace

const Vertebra& level_of(const Eigen::Vector3d& at_patient_mm, const std::vector<Vertebra>& vertebrae) {
  return *std::ranges::min_element(
      vertebrae, {}, [&](const Vertebra& v) { return std::abs(v.center_patient_mm.z() - at_patient_mm.z()); });
}

std::vector<Vertebra> find_vertebrae(const Volume<float>& ct_hu, const Volume<float>& hu_on_patient_axes) {
  constexpr std::ptrdiff_t kSurely = 4, kLeast = 2;
  std::vector<Vertebra> found = vertebrae_along(ct_hu, hu_on_patient_axes, SpineSigns::kBodyCanalArch);
  if (with_edges(found) < kSurely) {
    std::vector<Vertebra> others = vertebrae_along(ct_hu, hu_on_patient_axes, SpineSigns::kBodyAlone);
    if (with_edges(others) > with_edges(found)) found = std::move(others);
  }
  const bool is_spine = with_edges(found) >= kLeast && 2 * with_edges(found) >= std::ssize(found);
  return is_spine ? found : std::vector<Vertebra>();
}

bool ends_below_head(const std::vector<Vertebra>& vertebrae, const Volume<float>& hu_on_patient_axes) {
  constexpr double kHeadMm = 60.0;
  const Eigen::Vector3d last =
      hu_on_patient_axes.patient_from_voxel * Eigen::Vector3d(0.0, 0.0, hu_on_patient_axes.size.z() - 1.0);
  return last.z() - vertebrae.back().upper.center_patient_mm.z() < kHeadMm;
}

bool is_trunk(const std::vector<Vertebra>& vertebrae, const Volume<float>& hu_on_patient_axes) {
  constexpr std::size_t kSurely = 4;
  return vertebrae.size() >= kSurely || (!vertebrae.empty() && ends_below_head(vertebrae, hu_on_patient_axes));
}

}  // namespace isoshift
