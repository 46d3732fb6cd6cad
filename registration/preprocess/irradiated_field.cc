#include "registration/preprocess/irradiated_field.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>

#include "registration/preprocess/field_edges.h"
#include "registration/preprocess/field_sides.h"

namespace isoshift {
namespace {

// Evidence (EdgeMap::mean) of a side. Those of 200 simulated fields had 0.77 and more but for one; the clearest edge of
// an open image 0.72.
constexpr double kClear = 0.75;
constexpr double kFaint = 0.6;            // a single edge below this is none
constexpr double kDeclaredEvidence = 0.3;  // of a side where a file says that there is one
constexpr double kEndEvidence = 0.2;      // of the last 12 mm of a side, if it does not end there
constexpr double kMaxScatterMm = 1.0;     // of a straight edge; the true ones had 0.6, over bone 1.0
constexpr double kMaxSigmaMm = 0.5;
constexpr double kRodBrightness = -0.5;   // beyond a rod; beyond a field's side the image has less than half
constexpr double kSameMm = 3.0;           // a side and a declared jaw
constexpr double kTurnSigma = 0.005;      // of the collimator angle, 0.3 degrees
constexpr double kMaxTurn = 0.0175;       // 1 degree
constexpr std::array kNames = {"left", "right", "upper", "lower"};

struct Side {
  FieldSide edge;
  SideLine line;
  double brightness_beyond = -10.0;
  double seen = 0.0;  // share of its blocks

  bool is_open() const { return edge.is_open; }
  bool is_straight() const { return seen > 0.5 && line.scatter_mm <= kMaxScatterMm; }
  bool is_clear() const { return edge.evidence >= kClear && is_straight(); }
};

using Sides = std::array<Side, 4>;

// An X-ray turned upright, both ways.
struct Upright {
  explicit Upright(UprightXray image) : xray(std::move(image)), transposed(xray.transposed()) {}
  UprightXray xray, transposed;

  const UprightXray& of(std::size_t side) const { return side < 2 ? xray : transposed; }
};

// The four sides measured: each by itself, then all with the turn that they share.
Sides measured(const Upright& upright, const FieldRectangle& rectangle) {
  Sides sides;
  const double mm = upright.xray.mm;
  const int corner = static_cast<int>(std::lround(4.0 / mm));
  std::array<SideSightings, 4> sightings;
  double turn = 0.0, weights = 1.0 / (kTurnSigma * kTurnSigma);
  for (std::size_t n = 0; n < 4; ++n) {
    Side& side = sides[n];
    side.edge = rectangle.sides[n];
    side.line.at = side.edge.at;
    if (side.is_open()) continue;
    const std::size_t across = n < 2 ? 2 : 0;
    const FieldSide &before = rectangle.sides[across], &after = rectangle.sides[across + 1];
    const int first = before.at + (before.is_open ? 0 : corner), end = after.at - (after.is_open ? 0 : corner);
    const int sign = n % 2 == 0 ? 1 : -1;
    sightings[n] = sightings_of_side(upright.of(n), side.edge.at, sign, first, end);
    side.brightness_beyond = brightness_beyond(upright.of(n), side.edge.at, sign, first, end);
    side.line.middle = 0.5 * (first + end);
    side.seen = static_cast<double>(sightings[n].seen.size()) / std::max(1, sightings[n].blocks);
    if (sightings[n].seen.empty()) {
      side.line.sigma_mm = side.line.scatter_mm = 1e3;
      continue;
    }
    const SideLine alone = line_through(sightings[n].seen, mm, 0.0, 2.0 * kTurnSigma);
    const double weight = 1.0 / (alone.slope_sigma * alone.slope_sigma);
    weights += weight;
    turn += weight * (n < 2 ? -alone.slope : alone.slope);
  }
  turn /= weights;
  for (std::size_t n = 0; n < 4; ++n)
    if (!sightings[n].seen.empty())
      sides[n].line = line_through(sightings[n].seen, mm, n < 2 ? -turn : turn, 1e-5);
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
    corners.push_back(mapping.image(corner_of(sides[static_cast<std::size_t>(across)].line,
                                              sides[static_cast<std::size_t>(down)].line)));
  return corners;
}

// What is found in the image alone.
struct Finding {
  Sides sides;
  bool is_whole = true;
  std::string doubt;
};

int found(const Sides& sides) { return static_cast<int>(std::ranges::count(sides, false, &Side::is_open)); }
int clear(const Sides& sides) { return static_cast<int>(std::ranges::count(sides, true, &Side::is_clear)); }

// Why sides that were found may be wrong; empty: they are sure.
std::string doubt_about(const Sides& sides) {
  for (std::size_t n = 0; n < 4; ++n) {
    const Side& side = sides[n];
    if (side.is_open()) continue;
    if (!side.is_straight()) return fmt::format("its {} edge is not straight", kNames[n]);
    if (side.edge.evidence < kClear)
      return fmt::format("its {} edge is seen along {:.0f} % of its length", kNames[n],
                         50.0 * (1.0 + std::max(0.0, side.edge.evidence)));
    if (side.edge.at_ends < kEndEvidence) return fmt::format("its {} edge ends before its corner", kNames[n]);
    if (side.line.sigma_mm > kMaxSigmaMm)
      return fmt::format("its {} edge is uncertain by {:.1f} mm", kNames[n], side.line.sigma_mm);
    if (std::abs(side.line.slope) > kMaxTurn)
      return fmt::format("its edges are turned by {:.1f} degrees against the collimator angle",
                         std::abs(side.line.slope) * 180.0 / M_PI);
  }
  return {};
}

// Whether a rectangle with one side or two can be a rod, a couch or the patient: these are bright again beyond.
bool may_be_rod(const Sides& sides) {
  return found(sides) < 3 && std::ranges::any_of(sides, [](const Side& side) {
           return !side.is_open() && side.brightness_beyond > kRodBrightness;
         });
}

Finding find_in(const Upright& upright, const FieldEdges& edges) {
  const FieldRectangle rectangle = edges.best();
  Finding finding{.sides = measured(upright, rectangle)};
  Sides& sides = finding.sides;
  const bool is_single = found(sides) == 1;
  const auto single = std::ranges::find(sides, false, &Side::is_open);
  const bool is_edge = clear(sides) > 0 ? !may_be_rod(sides) : false;
  if (is_edge) {
    finding.is_whole = false;
    finding.doubt = doubt_about(sides);
    return finding;
  }
  // No field. An edge that is not clear enough, and still straight and dark beyond, is a reason to ask.
  if (is_single && single->edge.evidence >= kFaint && single->is_straight() && !may_be_rod(sides))
    finding.doubt = fmt::format("a faint edge may be its {} side", kNames[static_cast<std::size_t>(single - sides.begin())]);
  if (found(sides) > 1) finding.doubt = "edges are seen that make no clear rectangle";
  finding.sides = measured(upright, edges.near({-1e6, 1e6, -1e6, 1e6}));
  return finding;
}

void debug(const Sides& sides) {
  if (!std::getenv("FIELD_DEBUG")) return;
  for (const Side& s : sides)
    if (s.is_open())
      printf("   open\n");
    else
      printf("   at %.2f ev %.2f ends %.2f sigma %.2f scatter %.2f seen %.2f slope %.4f beyond %.2f\n", s.line.at,
             s.edge.evidence, s.edge.at_ends, s.line.sigma_mm, s.line.scatter_mm, s.seen, s.line.slope, s.brightness_beyond);
}

}  // namespace

IrradiatedField find_irradiated_field(const XrayImage& xray, double pixels_per_mm) {
  const Upright upright(upright_xray(xray, pixels_per_mm));
  const FieldEdges edges(upright.xray);
  const Finding finding = find_in(upright, edges);
  IrradiatedField field;
  debug(finding.sides);
  field.corners_px = corners_of(Mapping(upright.xray), finding.sides);
  if (!finding.is_whole) field.origin = IrradiatedField::Origin::kFound;
  field.doubt = finding.doubt;
  for (const Side& side : finding.sides)
    if (!side.is_open()) field.sigma_mm = std::max(field.sigma_mm, side.line.sigma_mm);
  return field;
}

}  // namespace isoshift
