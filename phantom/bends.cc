// Rotations are about the patient's axes: x is left, y posterior, z superior.

#include "phantom/bends.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>

#include "base/error.h"

namespace isoshift {
namespace {

using Eigen::Vector3d;

constexpr double kRadPerDeg = std::numbers::pi / 180.0;

struct BendKind {
  Bend::Kind kind;
  std::string_view name, unit;
  double usual, most;                       // amounts; both 0 where none is given
  std::vector<std::string_view> anatomies;  // that have it
};

const std::vector<BendKind>& bend_kinds() {
  static const std::vector<BendKind> kinds = {
      {Bend::Kind::kNeck, "neck", "degrees", 5.0, 15.0, {"head"}},
      {Bend::Kind::kSpine, "spine", "degrees", 5.0, 12.0, {"spine", "thorax"}},
      {Bend::Kind::kJaw, "jaw", "degrees", 8.0, 25.0, {"head"}},
      {Bend::Kind::kShoulders, "shoulders", "mm", 15.0, 30.0, {"thorax"}},
      {Bend::Kind::kWeightLoss, "weight-loss", "mm", 8.0, 20.0, {"head", "spine", "thorax"}},
      {Bend::Kind::kMissingCouch, "missing-couch", "", 0.0, 0.0, {"head", "spine", "thorax"}},
      {Bend::Kind::kExtraCouch, "extra-couch", "", 0.0, 0.0, {"head", "spine", "thorax"}},
  };
  return kinds;
}

const BendKind& kind_of(const Bend& bend) {
  return *std::ranges::find_if(bend_kinds(), [&](const BendKind& kind) { return kind.kind == bend.kind; });
}

const Bend* find_bend(const std::vector<Bend>& bends, Bend::Kind kind) {
  const auto found = std::ranges::find_if(bends, [&](const Bend& bend) { return bend.kind == kind; });
  return found == bends.end() ? nullptr : &*found;
}

// A line of joints along the patient's z axis, each turned a little against the one before.
struct Chain {
  Vector3d start_patient_mm;
  double direction = 1.0;  // +1 toward the head, -1 toward the feet
  double growth_mm = 0.0;  // over which the rotation grows to its full angle
  Vector3d axis;
  double angle_rad = 0.0;

  Eigen::Matrix3d rotation_at(double distance_mm) const {
    const double u = std::clamp(distance_mm / growth_mm, 0.0, 1.0);
    return Eigen::AngleAxisd(angle_rad * u * u * (3.0 - 2.0 * u), axis).toRotationMatrix();
  }

  // The line keeps its length: where its point at this distance lies is the sum of its turned pieces.
  Eigen::Isometry3d motion_at(const Vector3d& point_patient_mm) const {
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    const double distance_mm = direction * (point_patient_mm.z() - start_patient_mm.z());
    if (distance_mm <= 0.0) return motion;
    const Vector3d along = direction * Vector3d::UnitZ();
    constexpr int kPieces = 64;
    const double piece_mm = distance_mm / kPieces;
    Vector3d moved_mm = start_patient_mm;
    for (int n = 0; n < kPieces; ++n) moved_mm += rotation_at((n + 0.5) * piece_mm) * along * piece_mm;
    motion.linear() = rotation_at(distance_mm);
    motion.translation() = moved_mm - motion.linear() * (start_patient_mm + distance_mm * along);
    return motion;
  }
};

std::vector<Chain> chains_of(const std::vector<Bend>& bends, const BendingAnatomy& anatomy) {
  std::vector<Chain> chains;
  // The head keeps its place, and the neck below the skull base comes forward: chin toward the chest.
  constexpr double kSkullBaseMm = -44.0, kNeckMm = 60.0, kSpineMm = 100.0, kSideShare = 0.8;
  if (const Bend* neck = find_bend(bends, Bend::Kind::kNeck))
    chains.push_back({anatomy.isocenter_patient_mm + anatomy.spine_from_isocenter_mm + Vector3d(0.0, 0.0, kSkullBaseMm),
                      -1.0, kNeckMm, Vector3d::UnitX(), -neck->amount * kRadPerDeg});
  if (const Bend* spine = find_bend(bends, Bend::Kind::kSpine)) {
    const Vector3d start = anatomy.isocenter_patient_mm + anatomy.spine_from_isocenter_mm;
    chains.push_back({start, 1.0, kSpineMm, Vector3d::UnitX(), spine->amount * kRadPerDeg});
    chains.push_back({start, -1.0, kSpineMm, Vector3d::UnitY(), kSideShare * spine->amount * kRadPerDeg});
  }
  return chains;
}

// About a point, then along a way.
Eigen::Isometry3d turned_about(const Vector3d& point, const Vector3d& axis, double angle_rad, const Vector3d& way) {
  return Eigen::Translation3d(point + way) * Eigen::AngleAxisd(angle_rad, axis) * Eigen::Translation3d(-point);
}

Eigen::Isometry3d motion_of(const PhantomBody& body, const std::vector<Bend>& bends, const std::vector<Chain>& chains) {
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  if (body.name != "skull")
    for (const Chain& chain : chains)
      if (body.name != "mandible") motion = chain.motion_at(body.carried_at_patient_mm) * motion;
  const Bend* jaw = find_bend(bends, Bend::Kind::kJaw);
  if (jaw != nullptr && body.name == "mandible")
    motion = turned_about(body.carried_at_patient_mm, Vector3d::UnitX(), jaw->amount * kRadPerDeg, Vector3d::Zero());
  const Bend* shoulders = find_bend(bends, Bend::Kind::kShoulders);
  if (shoulders != nullptr && body.name.starts_with("shoulder")) {
    // Shrugged: up, and the outer end higher than the inner one by a degree for every 3 mm.
    const double side = body.name.ends_with("left") ? 1.0 : -1.0;
    motion = turned_about(body.carried_at_patient_mm, Vector3d::UnitY(), -side * shoulders->amount / 3.0 * kRadPerDeg,
                          Vector3d(0.0, 0.0, shoulders->amount)) *
             motion;
  }
  return motion;
}

Shape moved(Shape shape, const Eigen::Isometry3d& moved_from_planned) {
  shape.unit_from_patient = shape.unit_from_patient * moved_from_planned.inverse();
  return shape;
}

// Thinner by `mm` at both sides and in front. The back keeps its place, as it lies on the couch, and so do the ends of
// a cylinder, where the scanned part is cut off.
void shrink(Shape& shape, double mm) {
  Eigen::Affine3d patient_from_unit = shape.unit_from_patient.inverse();
  const Eigen::Vector3d half_mm = patient_from_unit.linear().colwise().norm();
  patient_from_unit.linear().col(0) *= (half_mm.x() - mm) / half_mm.x();
  patient_from_unit.linear().col(1) *= (half_mm.y() - 0.5 * mm) / half_mm.y();
  patient_from_unit.translation().y() += 0.5 * mm;
  shape.unit_from_patient = patient_from_unit.inverse();
}

// Foam between two skins of carbon fiber.
std::vector<Shape> couch(const BendingAnatomy& anatomy) {
  constexpr double kThickMm = 10.0, kSkinMm = 1.2, kHalfLengthMm = 400.0;
  std::vector<Shape> shapes;
  const auto plate = [&](double begin_mm, double thick_mm, double water) {
    shapes.push_back(make_shape(
        Shape::Kind::kBox,
        anatomy.isocenter_patient_mm + Vector3d(anatomy.spine_from_isocenter_mm.x(),
                                                anatomy.couch_top_from_isocenter_mm + begin_mm + 0.5 * thick_mm, 0.0),
        Vector3d(0.5 * anatomy.couch_width_mm, 0.5 * thick_mm, kHalfLengthMm), {.water = water, .bone = 0.0}));
  };
  plate(0.0, kSkinMm, 1.4);
  plate(kSkinMm, kThickMm - 2.0 * kSkinMm, 0.08);
  plate(kThickMm - kSkinMm, kSkinMm, 1.4);
  return shapes;
}

}  // namespace

Bend Bend::from_text(std::string_view text) {
  const std::size_t colon = text.find(':');
  const std::string_view name = text.substr(0, colon);
  const auto kind = std::ranges::find(bend_kinds(), name, &BendKind::name);
  if (kind == bend_kinds().end()) {
    std::vector<std::string_view> names;
    for (const BendKind& known : bend_kinds()) names.push_back(known.name);
    throw UsageError(fmt::format("--bend {}: no such bend; there are {}", text, fmt::join(names, ", ")));
  }
  Bend bend{.kind = kind->kind, .amount = kind->usual};
  if (colon == std::string_view::npos) return bend;
  if (kind->most == 0.0) throw UsageError(fmt::format("--bend {}: a couch has no amount; give {} alone", text, name));
  const std::string_view amount = text.substr(colon + 1);
  const auto [end, error] = std::from_chars(amount.data(), amount.data() + amount.size(), bend.amount);
  if (error != std::errc() || end != amount.data() + amount.size() || !(std::abs(bend.amount) <= kind->most))
    throw UsageError(fmt::format("--bend {}: expected a number of at most {} {}", text, kind->most, kind->unit));
  if (bend.kind == Kind::kWeightLoss && bend.amount < 0.0)
    throw UsageError(fmt::format("--bend {}: tissue that is lost is a number of 0 or more mm", text));
  return bend;
}

std::string Bend::text() const {
  const BendKind& of_bend = kind_of(*this);
  return of_bend.most == 0.0 ? std::string(of_bend.name) : fmt::format("{}:{}", of_bend.name, amount);
}

void check_bends(const std::vector<Bend>& bends, std::string_view anatomy, std::string_view patient_position) {
  for (const Bend& bend : bends) {
    const BendKind& kind = kind_of(bend);
    if (std::ranges::find(kind.anatomies, anatomy) == kind.anatomies.end())
      throw UsageError(fmt::format("--bend {}: a phantom of a {} has no such part; --anatomy {} has it", kind.name,
                                   anatomy, fmt::join(kind.anatomies, ", ")));
    if (std::ranges::count(bends, bend.kind, &Bend::kind) > 1)
      throw UsageError(fmt::format("--bend {} is given twice", kind.name));
    const bool is_couch = bend.kind == Bend::Kind::kMissingCouch || bend.kind == Bend::Kind::kExtraCouch;
    if (is_couch && patient_position != "HFS" && patient_position != "FFS")
      throw UsageError(
          fmt::format("--bend {}: the couch lies behind the back, so that the patient must be HFS or FFS, "
                      "not {}",
                      kind.name, patient_position));
  }
  if (find_bend(bends, Bend::Kind::kMissingCouch) != nullptr && find_bend(bends, Bend::Kind::kExtraCouch) != nullptr)
    throw UsageError("--bend missing-couch and extra-couch together: either the CT or the X-rays show the couch");
}

void make_vertebrae_differ(PhantomParts& parts, std::uint64_t seed) {
  // Numbers of its own, so that the phantom's other differences stay.
  std::mt19937_64 random(seed ^ 0x5eed0f7e27eb2a5ULL);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  constexpr double kProcessBehindMm = 15.0;  // what lies farther behind the vertebral body's center is a process
  for (std::size_t body = 0; body < parts.bodies.size(); ++body) {
    if (!parts.bodies[body].is_vertebra) continue;
    const Vector3d& center = parts.bodies[body].center_patient_mm;
    const Vector3d size(1.0 + 0.10 * uniform(random), 1.0 + 0.10 * uniform(random), 1.0 + 0.06 * uniform(random));
    const Vector3d process(1.0 + 0.15 * uniform(random), 1.0 + 0.15 * uniform(random), 1.0 + 0.25 * uniform(random));
    for (Shape& shape : parts.shapes) {
      if (shape.body != static_cast<int>(body)) continue;
      const Vector3d at = shape.unit_from_patient.inverse().translation() - center;
      const Vector3d& share = at.y() > kProcessBehindMm ? process : size;
      shape.unit_from_patient = shape.unit_from_patient * Eigen::Translation3d(center) *
                                Eigen::Scaling(Vector3d(share.cwiseInverse())) * Eigen::Translation3d(-center);
    }
  }
}

BentPhantom bent(PhantomParts parts, const std::vector<Bend>& bends, const BendingAnatomy& anatomy) {
  const std::vector<Chain> chains = chains_of(bends, anatomy);
  BentPhantom phantom;
  for (const PhantomBody& body : parts.bodies) phantom.bodies.push_back({body, motion_of(body, bends, chains)});
  phantom.in_ct = parts.shapes;
  if (const Bend* loss = find_bend(bends, Bend::Kind::kWeightLoss))
    for (const PhantomParts::Outline& outline : parts.outlines)
      shrink(parts.shapes[outline.shape], std::min(loss->amount, outline.most_mm));
  for (const Shape& shape : parts.shapes) {
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    const Vector3d center = shape.unit_from_patient.inverse().translation();
    if (shape.body >= 0)
      motion = phantom.bodies[static_cast<std::size_t>(shape.body)].moved_from_planned;
    else
      for (const Chain& chain : chains) motion = chain.motion_at(center) * motion;
    phantom.in_xrays.push_back(moved(shape, motion));
  }
  const auto add_couch = [&](std::vector<Shape>& shapes) {
    for (const Shape& shape : couch(anatomy)) shapes.push_back(shape);
  };
  if (find_bend(bends, Bend::Kind::kMissingCouch) != nullptr) add_couch(phantom.in_ct);
  if (find_bend(bends, Bend::Kind::kExtraCouch) != nullptr) add_couch(phantom.in_xrays);
  return phantom;
}

}  // namespace isoshift
