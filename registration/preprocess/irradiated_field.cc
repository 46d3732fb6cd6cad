#include "registration/preprocess/irradiated_field.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "geometry/rotation.h"
#include "registration/preprocess/field_edges.h"
#include "registration/preprocess/field_sides.h"
#include "registration/preprocess/leaf_outline.h"
#include "registration/preprocess/small_field.h"

namespace isoshift {
namespace {

// Evidence (EdgeMap::mean) of a side. Those of 200 simulated fields had 0.77 and more but for one; the clearest edge of
// an open image 0.72.
constexpr double kClear = 0.75;
constexpr double kFaint = 0.6;             // a single edge below this is none
constexpr double kDeclaredEvidence = 0.3;  // of a side where a file says that there is one
constexpr double kEndEvidence = 0.2;       // of the last 12 mm of a side, if it does not end there
constexpr double kMaxScatterMm = 1.0;      // of a straight edge; the true ones had 0.6, over bone 1.0
constexpr double kMaxSigmaMm = 0.5;
constexpr double kMaxWideMm = 1.45;       // of the places that explain a side nearly as well
constexpr double kMaxWideOfPoorMm = 0.8;  // the same of a side
constexpr double kPoorMisfit = 0.12;      // that is explained no better than this
// The same of one side that crosses dense bone, of a field that only a collimator makes. Skulls: 1.15 to 1.3 mm and 1.4
// to 1.6 times as wide, found within 0.8 mm.
constexpr double kLeastSeenOverBone = 0.4, kMaxScatterOverBoneMm = 1.5, kWideOfScatter = 1.7;
// Of a field that only a collimator makes: wider places than usual are kept off instead of doubted.
constexpr double kMaxWideKeptOffMm = 2.5;
constexpr double kCollimatorScatterMm = 0.45;  // of a collimator's edge; the outlines of air and patient have more
constexpr double kRodBrightness = -0.5;        // beyond a rod; beyond a field's side the image has less than half
constexpr double kJawToleranceMm = 3.0;        // a side and a declared jaw
constexpr double kInnerMarginMm = 4.0;         // of a side's penumbra, when edges further in are looked for
constexpr double kShadedCornerMm = 4.0;        // of a side, that the penumbra of the next one shades
constexpr double kTurnSigma = 0.003;           // of the collimator angle, 0.2 degrees
constexpr double kMaxTurn = 0.0175;            // 1 degree
constexpr std::array kNames = {"left", "right", "upper", "lower"};

struct Side {
  FieldSide edge;
  SideLine line;
  double brightness_beyond = -10.0;
  // Without the scale of the intensity, half of it is not where half the beam arrives.
  double least_seen = 0.5, max_scatter_mm = kMaxScatterMm;

  bool is_open() const { return edge.is_open; }
  bool is_straight() const { return line.seen > least_seen && line.scatter_mm <= max_scatter_mm; }
  bool is_clear() const { return edge.evidence >= kClear && is_straight(); }
};

using Sides = std::array<Side, 4>;

// An X-ray turned upright, both ways.
struct Upright {
  explicit Upright(UprightXray image) : xray(std::move(image)), transposed(xray.transposed()) {}
  UprightXray xray, transposed;

  const UprightXray& of(std::size_t side) const { return side < 2 ? xray : transposed; }
};

// The four sides measured, all with the turn and the penumbra that they share.
Sides measured(const Upright& upright, const FieldRectangle& rectangle) {
  Sides sides;
  const int corner = static_cast<int>(std::lround(kShadedCornerMm / upright.xray.mm));
  const bool has_slope = std::ranges::any_of(rectangle.sides, &FieldSide::has_slope);
  std::vector<SideToMeasure> to_measure;
  for (std::size_t n = 0; n < 4; ++n) {
    Side& side = sides[n];
    side.edge = rectangle.sides[n];
    side.line.at = side.edge.at;
    if (!upright.xray.has_scale) side.least_seen = 0.3, side.max_scatter_mm = 2.0 * kMaxScatterMm;
    if (side.is_open()) continue;
    const std::size_t across = n < 2 ? 2 : 0;
    const FieldSide &before = rectangle.sides[across], &after = rectangle.sides[across + 1];
    const int sign = n % 2 == 0 ? 1 : -1;
    side.brightness_beyond = brightness_beyond(upright.of(n), side.edge.at, sign, before.at, after.at);
    to_measure.push_back({.xray = &upright.of(n),
                          .near = side.edge.at,
                          .sign = sign,
                          .first = before.at + (before.is_open ? 0 : corner),
                          .end = after.at - (after.is_open ? 0 : corner),
                          .slope_sign = n < 2 ? -1 : 1,
                          .has_slope = has_slope});
  }
  const std::vector<SideLine> lines = measured_lines(to_measure, kTurnSigma);
  auto line = lines.begin();
  for (Side& side : sides)
    if (!side.is_open()) side.line = *line++;
  return sides;
}

// Where an upright side and a level one meet.
Eigen::Vector2d corner_of(const SideLine& upright, const SideLine& level) {
  double x = upright.at, y = level.at;
  for (int round = 0; round < 4; ++round) {
    y = level.x(x);
    x = upright.x(y);
  }
  return {x, y};
}

// Positions on the image and on the upright one.
struct Mapping {
  explicit Mapping(const UprightXray& xray)
      : linear{{xray.from_image(0, 0), xray.from_image(0, 1)}, {xray.from_image(1, 0), xray.from_image(1, 1)}},
        offset(xray.from_image(0, 2), xray.from_image(1, 2)) {}
  Eigen::Matrix2d linear;
  Eigen::Vector2d offset;

  Eigen::Vector2d upright(const Eigen::Vector2d& image_px) const { return linear * image_px + offset; }
  Eigen::Vector2d image(const Eigen::Vector2d& upright_px) const { return linear.inverse() * (upright_px - offset); }
};

std::vector<Eigen::Vector2d> corners_of(const Mapping& mapping, const Sides& sides) {
  std::vector<Eigen::Vector2d> corners;
  for (const auto& [across, down] : {std::pair{0, 2}, {1, 2}, {1, 3}, {0, 3}})
    corners.push_back(mapping.image(
        corner_of(sides[static_cast<std::size_t>(across)].line, sides[static_cast<std::size_t>(down)].line)));
  return corners;
}

// Of a circle: a polygon that leaves it by less than a hundredth of its radius.
std::vector<Eigen::Vector2d> circle_of(const Mapping& mapping, const Sides& sides) {
  constexpr int kCorners = 32;
  const double radius = 0.25 * (sides[1].line.at - sides[0].line.at + sides[3].line.at - sides[2].line.at);
  const Eigen::Vector2d middle =
      0.5 * Eigen::Vector2d(sides[0].line.at + sides[1].line.at, sides[2].line.at + sides[3].line.at);
  std::vector<Eigen::Vector2d> corners;
  for (int n = 0; n < kCorners; ++n) {
    const double angle = 2.0 * std::numbers::pi * n / kCorners;
    corners.push_back(mapping.image(middle + radius * Eigen::Vector2d(std::cos(angle), std::sin(angle))));
  }
  return corners;
}

int sides_found(const Sides& sides) { return static_cast<int>(std::ranges::count(sides, false, &Side::is_open)); }
int sides_clear(const Sides& sides) { return static_cast<int>(std::ranges::count(sides, true, &Side::is_clear)); }

// Whether nothing but a collimator makes such an edge, wherever exactly it lies.
bool is_unmistakable(const Side& side) {
  constexpr double kEvidence = 0.95, kEnds = 0.9, kBeyond = -2.0;
  return side.edge.evidence >= kEvidence && side.edge.at_ends >= kEnds && side.brightness_beyond < kBeyond;
}

// How wide the places of a sure side are.
double usual_width_mm(const Side& side) { return side.line.misfit > kPoorMisfit ? kMaxWideOfPoorMm : kMaxWideMm; }

// Why a side that was found may be wrong; empty: it is sure. `may_scatter`: as edges over dense bone do. `kept_off_mm`:
// how wide its places may be, because what is compared keeps off them.
std::string doubt_about(const Side& side, const char* name, bool may_scatter, double kept_off_mm) {
  const bool is_straight = side.is_straight() || (may_scatter && side.line.seen > kLeastSeenOverBone &&
                                                  side.line.scatter_mm <= kMaxScatterOverBoneMm);
  if (!is_straight) return fmt::format("its {} edge is not straight", name);
  if (side.edge.evidence < kClear) return fmt::format("its {} edge is faint", name);
  if (side.edge.at_ends < kEndEvidence) return fmt::format("its {} edge ends before the corner", name);
  if (side.line.sigma_mm > kMaxSigmaMm)
    return fmt::format("its {} edge is uncertain by {:.1f} mm", name, side.line.sigma_mm);
  // Where the blocks of a side scatter, many lines fit nearly as well, and their middle is right; where the blocks
  // agree and many lines fit nevertheless, two places are as likely.
  const double by_scatter_mm = may_scatter ? kWideOfScatter * side.line.scatter_mm : 0.0;
  if (side.line.wide_mm > std::max({by_scatter_mm, usual_width_mm(side), kept_off_mm}))
    return fmt::format("its {} edge may lie {:.1f} mm farther in or out", name, side.line.wide_mm);
  if (std::abs(side.line.slope) > kMaxTurn)
    return fmt::format("its edges are turned by {:.1f} degrees against the collimator angle",
                       deg_from_rad(std::abs(side.line.slope)));
  return {};
}

// Why sides that were found may be wrong; empty: they are sure.
std::string doubt_about(const Sides& sides) {
  std::vector<std::size_t> doubtful;
  for (std::size_t n = 0; n < sides.size(); ++n)
    if (!sides[n].is_open() && !doubt_about(sides[n], kNames[n], false, 0.0).empty()) doubtful.push_back(n);
  const bool is_field = std::ranges::all_of(sides, is_unmistakable);
  for (const std::size_t n : doubtful) {
    const bool may_scatter = is_field && doubtful.size() == 1;
    std::string doubt = doubt_about(sides[n], kNames[n], may_scatter, is_field ? kMaxWideKeptOffMm : 0.0);
    if (!doubt.empty()) return doubt;
  }
  return {};
}

// How far the field may end inside of its sides, beyond what is usual for sure ones.
double to_keep_off_mm(const Sides& sides) {
  double most_mm = 0.0;
  for (const Side& side : sides)
    if (!side.is_open() && side.line.wide_mm > usual_width_mm(side)) most_mm = std::max(most_mm, side.line.wide_mm);
  return most_mm;
}

// Rods, couches and patients are bright again beyond; a field is dark there.
int sides_bright_beyond(const Sides& sides) {
  return static_cast<int>(std::ranges::count_if(
      sides, [](const Side& side) { return !side.is_open() && side.brightness_beyond > kRodBrightness; }));
}

// Whether a rectangle with one side or two can be a rod, a couch or the patient.
bool may_be_rod(const Sides& sides) { return sides_found(sides) < 3 && sides_bright_beyond(sides) > 0; }

// Whether a rectangle with one side or two leaves the isocenter out, as a strip of air beside the patient does.
bool is_beside(const Sides& sides, const Eigen::Vector2d& isocenter_upright_px, double mm) {
  constexpr double kToleranceMm = 5.0;
  const auto beyond_mm = [&](std::size_t low, double at) {
    return std::max(sides[low].line.at - at, at - sides[low + 1].line.at) * mm;
  };
  return sides_found(sides) < 3 &&
         std::max(beyond_mm(0, isocenter_upright_px.x()), beyond_mm(2, isocenter_upright_px.y())) > kToleranceMm;
}

// Whether an edge is as clear, as straight and as dark beyond as only a collimator's is. Of two that make a corner, as
// patients and couches do not, less darkness will do.
bool is_collimator(const Side& side, bool makes_corner) {
  constexpr double kBeyond = -1.5, kBeyondOfCorner = -0.8, kEnds = 0.9, kSeen = 0.9;
  return !side.is_open() && side.edge.evidence >= kClear && side.edge.at_ends >= kEnds && side.line.seen >= kSeen &&
         side.line.scatter_mm <= kCollimatorScatterMm &&
         side.brightness_beyond < (makes_corner ? kBeyondOfCorner : kBeyond);
}
bool make_corner(const Sides& sides) {
  return (!sides[0].is_open() || !sides[1].is_open()) && (!sides[2].is_open() || !sides[3].is_open());
}

// The field as the image alone shows it.
struct FoundField {
  Sides sides;
  std::string doubt = {};
  bool is_round = false;  // the circle that touches the sides
};

// What a cone or stereotactic leaves leave of the treatment beam.
std::optional<FoundField> small_finding(const XrayImage& xray, const UprightXray& upright) {
  if (xray.view.beam != Beam::kMegavoltage) return std::nullopt;
  const std::optional<SmallField> field = find_small_field(upright);
  if (!field) return std::nullopt;
  FoundField finding{.sides = {}, .is_round = field->is_round};
  for (std::size_t n = 0; n < 4; ++n) {
    const double at = field->sides[n];
    finding.sides[n].edge = {.at = static_cast<int>(std::lround(at)), .is_open = false};
    finding.sides[n].line = {.at = at, .sigma_mm = field->sigma_mm};
  }
  return finding;
}

FoundField find_in(const Upright& upright, const FieldEdges& edges, const Eigen::Vector2d& isocenter_upright_px) {
  FoundField finding{.sides = measured(upright, edges.best())};
  const Sides& sides = finding.sides;
  const bool is_aside = is_beside(sides, isocenter_upright_px, upright.xray.mm);
  const bool is_anatomy = is_aside || may_be_rod(sides);
  if (sides_clear(sides) > 0 && !is_anatomy) {
    finding.doubt = doubt_about(sides);
    return finding;
  }
  const auto is_edge_of_collimator = [corner = make_corner(sides)](const Side& side) {
    return is_collimator(side, corner);
  };
  if (is_anatomy && std::ranges::any_of(sides, is_edge_of_collimator)) {
    finding.doubt = "a collimator's edge leaves the isocenter out";
    // Beside the isocenter there may be nothing but air.
    if (!is_aside &&
        std::ranges::all_of(sides, [&](const Side& side) { return side.is_open() || is_edge_of_collimator(side); }))
      return finding;
    finding.sides = measured(upright, edges.whole());
    return finding;
  }
  // No field. Edges that are not clear enough, straight and dark beyond all the same, are a reason to ask.
  const auto side = std::ranges::find(sides, false, &Side::is_open);
  const auto number = static_cast<std::size_t>(side - sides.begin());
  if (!is_anatomy && sides_found(sides) > 1 && sides_bright_beyond(sides) < 2)
    finding.doubt = "edges are seen that make no clear rectangle";
  else if (sides_found(sides) == 1 && side->edge.evidence >= kFaint && side->is_straight() && !is_anatomy)
    finding.doubt = fmt::format("a faint edge may be its {} side", kNames[number]);
  finding.sides = measured(upright, edges.whole());
  return finding;
}

// Leaves may stand before jaws, whose leakage ends at an edge of its own: the innermost rectangle with at least three
// clear sides.
FoundField innermost(const Upright& upright, FoundField outer) {
  const int margin = static_cast<int>(std::lround(kInnerMarginMm / upright.xray.mm));
  cv::Rect part(cv::Point(), upright.xray.intensity.size());
  for (;;) {
    std::array<int, 4> rim{};
    for (std::size_t n = 0; n < 4; ++n)
      rim[n] = static_cast<int>(std::lround(outer.sides[n].line.at)) +
               (outer.sides[n].is_open() ? 0 : (n % 2 == 0 ? margin : -margin));
    const cv::Rect inside = cv::Rect(rim[0], rim[2], rim[1] - rim[0], rim[3] - rim[2]) & part;
    if (sides_found(outer.sides) < 3 || inside.width < 2 * margin || inside.height < 2 * margin) return outer;
    const Upright cropped(upright.xray.cropped(inside));
    const FieldEdges edges(cropped.xray);
    FoundField inner{.sides = measured(cropped, edges.best())};
    if (sides_clear(inner.sides) < 3) return outer;
    inner.doubt = doubt_about(inner.sides);
    for (std::size_t n = 0; n < 4; ++n) {
      Side& side = inner.sides[n];
      if (side.is_open()) {
        side = outer.sides[n];
        continue;
      }
      const cv::Point offset = n < 2 ? inside.tl() : cv::Point(inside.y, inside.x);
      side.line.at += offset.x;
      side.line.middle += offset.y;
    }
    outer = std::move(inner);
    part = inside;
  }
}

// The declared aperture: left, right, top and bottom on the upright image.
std::array<double, 4> declared_sides(const DeclaredAperture& aperture, const Mapping& mapping) {
  std::array<double, 4> sides = {1e9, -1e9, 1e9, -1e9};
  for (const Eigen::Vector2d& corner : aperture.corners_px) {
    const Eigen::Vector2d at = mapping.upright(corner);
    sides = {std::min(sides[0], at.x()), std::max(sides[1], at.x()), std::min(sides[2], at.y()),
             std::max(sides[3], at.y())};
  }
  return sides;
}

// Whether the image has an edge wherever the declared aperture has a side on the receptor.
bool is_confirmed(const Sides& sides) {
  return sides_found(sides) > 0 && std::ranges::all_of(sides, [](const Side& side) {
           return side.is_open() || (side.edge.evidence >= kDeclaredEvidence && side.is_straight());
         });
}

// Whether a field lies within the declared aperture, give or take kJawToleranceMm: leaves may close it further.
bool is_within(const Sides& sides, const std::array<double, 4>& declared, double mm) {
  for (std::size_t n = 0; n < 4; ++n)
    if ((n % 2 == 0 ? 1.0 : -1.0) * (declared[n] - sides[n].line.at) * mm > kJawToleranceMm) return false;
  return true;
}

// Whether sides go beyond the declared ones on the receptor at all.
bool reaches_rim(const std::array<double, 4>& declared, const cv::Size& size, double mm) {
  return declared[0] * mm <= kJawToleranceMm && declared[2] * mm <= kJawToleranceMm &&
         (size.width - declared[1]) * mm <= kJawToleranceMm && (size.height - declared[3]) * mm <= kJawToleranceMm;
}

// Whether a clear side lies so far within the declared one that this cannot be the field's: leaves or a cone closed it.
bool is_closed_further(const Sides& sides, const std::array<double, 4>& declared, double mm) {
  for (std::size_t n = 0; n < 4; ++n)
    if (sides[n].is_clear() && (n % 2 == 0 ? 1.0 : -1.0) * (sides[n].line.at - declared[n]) * mm > kJawToleranceMm)
      return true;
  return false;
}

// What is found, against what the file declares.
FoundField reconciled(FoundField in_image, const DeclaredAperture& aperture, const Upright& upright,
                      const FieldEdges& edges, IrradiatedField::Origin& origin) {
  const double mm = upright.xray.mm;
  const std::array<double, 4> declared = declared_sides(aperture, Mapping(upright.xray));
  const bool is_all = reaches_rim(declared, upright.xray.intensity.size(), mm);
  const bool is_inside = is_within(in_image.sides, declared, mm);
  if (in_image.doubt.empty() && (is_inside || !aperture.is_of_exposure)) {
    const bool is_same = sides_found(in_image.sides) > 0 && std::ranges::all_of(std::array{0, 1, 2, 3}, [&](int n) {
                           const auto side = static_cast<std::size_t>(n);
                           return in_image.sides[side].is_open() ||
                                  std::abs(in_image.sides[side].line.at - declared[side]) * mm <= kJawToleranceMm;
                         });
    if (is_same) origin = IrradiatedField::Origin::kDeclared;
    return in_image;
  }
  if (!is_closed_further(in_image.sides, declared, mm)) {
    // Where a side is to be is known: fainter evidence will do.
    FoundField there{.sides = measured(upright, edges.near(declared))};
    if (is_confirmed(there.sides)) {
      origin = IrradiatedField::Origin::kDeclared;
      return there;
    }
  }
  if (aperture.is_of_exposure && !is_all && !is_inside)
    in_image.doubt = "the file declares a smaller aperture than the image shows" +
                     (in_image.doubt.empty() ? std::string() : "; " + in_image.doubt);
  return in_image;
}

// The part of a polygon on the receptor: cut at its four rims, one after the other (Sutherland and Hodgman).
std::vector<Eigen::Vector2d> on_receptor(std::vector<Eigen::Vector2d> polygon, int columns, int rows) {
  const std::array<Eigen::Vector3d, 4> rims = {Eigen::Vector3d(1, 0, 0.5), Eigen::Vector3d(-1, 0, columns - 0.5),
                                               Eigen::Vector3d(0, 1, 0.5), Eigen::Vector3d(0, -1, rows - 0.5)};
  for (const Eigen::Vector3d& rim : rims) {
    std::vector<Eigen::Vector2d> kept;
    for (std::size_t n = 0; n < polygon.size(); ++n) {
      const Eigen::Vector2d &here = polygon[n], &next = polygon[(n + 1) % polygon.size()];
      const double in_here = rim.dot(here.homogeneous()), in_next = rim.dot(next.homogeneous());
      if (in_here >= 0.0) kept.push_back(here);
      if ((in_here > 0.0 && in_next < 0.0) || (in_here < 0.0 && in_next > 0.0))
        kept.emplace_back(here + in_here / (in_here - in_next) * (next - here));
    }
    polygon = std::move(kept);
  }
  return polygon;
}

// The field that leaves make, where the file declares it and the image shows it.
std::optional<IrradiatedField> field_of_leaves(const XrayImage& xray, const UprightXray& upright) {
  constexpr double kShiftSigmaMm = 0.3;
  const Mapping mapping(upright);
  std::vector<Eigen::Vector2d> outline_px;
  for (const Eigen::Vector2d& corner : xray.declared_aperture->corners_px)
    outline_px.push_back(mapping.upright(corner));
  const auto shift_px = shift_to_seen_outline(upright, outline_px);
  if (!shift_px) return std::nullopt;
  IrradiatedField field{.origin = IrradiatedField::Origin::kDeclared, .sigma_mm = kShiftSigmaMm};
  for (const Eigen::Vector2d& corner : outline_px) field.corners_px.push_back(mapping.image(corner + *shift_px));
  field.corners_px = on_receptor(field.corners_px, xray.values.columns, xray.values.rows);
  return field;
}

// Whether the file declares leaves that make no rectangle, of the exposure itself.
bool has_leaves(const XrayImage& xray) {
  return xray.declared_aperture && xray.declared_aperture->is_of_exposure &&
         xray.declared_aperture->corners_px.size() > 4;
}

}  // namespace

IrradiatedField find_irradiated_field(const XrayImage& xray, double pixels_per_mm) {
  using Origin = IrradiatedField::Origin;
  const Upright upright(upright_xray(xray, pixels_per_mm));
  if (has_leaves(xray))
    if (auto field = field_of_leaves(xray, upright.xray)) return *field;
  const FieldEdges edges(upright.xray);
  const Eigen::Vector2d isocenter_px =
      Mapping(upright.xray).upright(xray.view.project(Eigen::Vector3d::Zero()).value());
  const std::optional<FoundField> small = small_finding(xray, upright.xray);
  FoundField finding = small ? *small : innermost(upright, find_in(upright, edges, isocenter_px));
  IrradiatedField field{.origin = sides_found(finding.sides) > 0 ? Origin::kFound : Origin::kWholeReceptor};
  if (xray.declared_aperture)
    finding = reconciled(std::move(finding), *xray.declared_aperture, upright, edges, field.origin);
  field.doubt = finding.doubt;
  if (field.is_sure() && has_leaves(xray)) field.doubt = "the file declares leaves that the image does not show";
  if (field.is_sure()) field.keep_off_mm = to_keep_off_mm(finding.sides);
  for (Side& side : finding.sides) {
    if (!side.is_open()) field.sigma_mm = std::max(field.sigma_mm, side.line.sigma_mm);
    // Blocks of pixels may not reach the rim.
    if (side.is_open()) side.line.at += side.line.at > 0.0 ? 1e3 : -1e3;
  }
  const Mapping mapping(upright.xray);
  field.corners_px =
      on_receptor(finding.is_round ? circle_of(mapping, finding.sides) : corners_of(mapping, finding.sides),
                  xray.values.columns, xray.values.rows);
  return field;
}

}  // namespace isoshift
