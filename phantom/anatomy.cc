// The bodies that isoshift phantom makes. Not anatomy lessons: enough bone, air and irregularity that a DRR of them
// asks of a registration what a patient's does.

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>
#include <string>

#include "phantom/anatomy.h"

namespace isoshift {
namespace {

using Kind = Shape::Kind;
using Eigen::Vector3d;

constexpr Material kTissue{.water = 1.0, .bone = 0.0};
constexpr Material kAirInTissue{.water = -1.0, .bone = 0.0};
constexpr Material bone_in_tissue(double share) { return {.water = -share, .bone = share}; }
constexpr Material taken_away(const Material& material) { return {.water = -material.water, .bone = -material.bone}; }

Eigen::Matrix3d tilt(double about_x_deg, double about_z_deg = 0.0) {
  const double rad_per_deg = std::numbers::pi / 180.0;
  return (Eigen::AngleAxisd(about_z_deg * rad_per_deg, Vector3d::UnitZ()) *
          Eigen::AngleAxisd(about_x_deg * rad_per_deg, Vector3d::UnitX()))
      .toRotationMatrix();
}

// Collects shapes placed about one center.
class Body {
 public:
  Body(const Vector3d& center, std::uint64_t seed) : center_(center), random_(seed) {}

  void add(Kind kind, const Vector3d& at, const Vector3d& half_extent, const Material& material,
           const Eigen::Matrix3d& rotation = Eigen::Matrix3d::Identity()) {
    parts_.shapes.push_back(make_shape(kind, center_ + at, half_extent, material, rotation));
    parts_.shapes.back().body = current_;
  }

  // The shapes that follow belong to this rigid body; motion reaches it at `carried_at`.
  void begin(const std::string& name, const Vector3d& at, const Vector3d& carried_at, bool is_vertebra = false) {
    current_ = static_cast<int>(parts_.bodies.size());
    parts_.bodies.push_back({name, center_ + at, center_ + carried_at, is_vertebra});
  }
  void begin(const std::string& name, const Vector3d& at) { begin(name, at, at); }
  void go_on_with(int body) { current_ = body; }
  // The shapes that follow are soft tissue, each by itself.
  void end() { current_ = -1; }
  // The shape added last is skin or fat that can become thinner by this much on every side.
  void note_outline(double most_mm) { parts_.outlines.push_back({parts_.shapes.size() - 1, most_mm}); }

  // A hollow ellipsoid of bone.
  void add_shell(const Vector3d& at, const Vector3d& outer, double thickness, double bone_share) {
    add(Kind::kEllipsoid, at, outer, bone_in_tissue(bone_share));
    add(Kind::kEllipsoid, at, outer.array() - thickness, taken_away(bone_in_tissue(bone_share)));
  }

  // Trabecular texture: denser and looser grains on or in an ellipsoid.
  void add_grains(int count, const Vector3d& at, const Vector3d& extent, bool on_surface) {
    for (int n = 0; n < count; ++n) {
      Vector3d direction(gauss_(random_), gauss_(random_), gauss_(random_));
      direction.normalize();
      const double depth = on_surface ? 1.0 : std::cbrt(uniform_(random_));
      const Vector3d grain =
          Vector3d(2.0 + 3.0 * uniform_(random_), 2.0 + 3.0 * uniform_(random_), 2.0 + 3.0 * uniform_(random_));
      add(Kind::kEllipsoid, at + depth * extent.cwiseProduct(direction), grain,
          bone_in_tissue(uniform_(random_) < 0.6 ? 0.6 : -0.35));
    }
  }

  // A place within `mm` of one along every axis.
  Vector3d near(const Vector3d& at, double mm) {
    return at +
           mm * Vector3d(2.0 * uniform_(random_) - 1.0, 2.0 * uniform_(random_) - 1.0, 2.0 * uniform_(random_) - 1.0);
  }

  double vary(double value, double share) { return value * (1.0 + share * (2.0 * uniform_(random_) - 1.0)); }

  PhantomParts take() { return std::move(parts_); }

 private:
  Vector3d center_;
  PhantomParts parts_;
  int current_ = -1;
  std::mt19937_64 random_;
  std::normal_distribution<double> gauss_;
  std::uniform_real_distribution<double> uniform_;
};

constexpr const char* side_name(double side) { return side < 0.0 ? "right" : "left"; }

// x is left, y posterior, z superior. Seeds differ as people do: by millimeters everywhere.
Body head(const Vector3d& center_patient_mm, std::uint64_t seed) {
  Body body(center_patient_mm, seed);
  constexpr double kPlacesMm = 4.0, kSidesMm = 1.5;  // how places differ between people, and between the sides of one
  constexpr int kSkull = 0, kMandible = 1;           // in the order in which they begin
  const Vector3d skull_at(0, 4, 20);
  const Vector3d skull(body.vary(66, 0.06), body.vary(84, 0.06), body.vary(72, 0.06));
  body.begin("skull", skull_at);
  body.add(Kind::kEllipsoid, skull_at, skull.array() + 7.0, kTissue);
  body.note_outline(4.0);
  body.add(Kind::kEllipsoid, body.near({0, -22, -45}, kSidesMm), {52, 62, 52},
           {.water = 0.55, .bone = 0.0});  // face, over the head's tissue
  body.note_outline(4.0);
  body.end();
  body.add(Kind::kCylinder, {0, 22, -70}, {46, 50, 34}, {.water = 0.5, .bone = 0.0});  // neck
  body.note_outline(10.0);
  body.go_on_with(kSkull);
  body.add_shell(skull_at, skull, body.vary(6.0, 0.2), 0.8);
  body.add_grains(110, skull_at, skull.array() - 3.0, true);

  const Vector3d orbit = body.near({31, -65, -14}, kPlacesMm), sinus = body.near({26, -52, -40}, kPlacesMm),
                 petrous = body.near({46, 18, -18}, kPlacesMm), jaw = body.near({44, -32, -66}, kPlacesMm),
                 mastoid = body.near({55, 28, -30}, kPlacesMm);
  body.begin("mandible", {0, jaw.y(), jaw.z()}, {0, -14, -44});  // carried at its joints
  for (const double side : {-1.0, 1.0}) {
    const auto there = [&](const Vector3d& at) { return body.near(Vector3d(side * at.x(), at.y(), at.z()), kSidesMm); };
    const Vector3d orbit_at = there(orbit), mastoid_at = there(mastoid);
    body.go_on_with(kSkull);
    body.add(Kind::kEllipsoid, orbit_at, {17, 17, 15}, {.water = 0.1, .bone = -0.1});
    body.add_shell(orbit_at, {20, 20, 18}, 2.5, 0.7);
    body.add(Kind::kEllipsoid, there(sinus), {13, 14, body.vary(15, 0.2)}, kAirInTissue);  // maxillary sinus
    body.add(Kind::kBox, there(petrous), {14, 9, 8}, bone_in_tissue(0.75), tilt(0, side * body.vary(35, 0.2)));
    body.go_on_with(kMandible);
    body.add(Kind::kBox, there(jaw), {4, 20, 22}, bone_in_tissue(0.7), tilt(body.vary(20, 0.3)));
    body.go_on_with(kSkull);
    body.add(Kind::kEllipsoid, mastoid_at, {9, 12, 14}, bone_in_tissue(0.4));
    body.add(Kind::kEllipsoid, mastoid_at, {4, 6, 7}, {.water = -0.3, .bone = 0});
  }
  body.add(Kind::kEllipsoid, {body.vary(6, 1.0), -74, 10}, {body.vary(20, 0.3), 6, 9}, kAirInTissue);  // frontal sinus
  body.add(Kind::kEllipsoid, body.near({0, -30, -22}, kPlacesMm), {11, 12, 9}, kAirInTissue);          // sphenoid sinus
  body.add(Kind::kBox, body.near({0, -6, -24}, kPlacesMm), {20, 24, 4}, bone_in_tissue(0.55),
           tilt(body.vary(-12, 0.5)));  // skull base
  const Vector3d teeth = body.near({0, -61, -69}, kPlacesMm);
  body.add(Kind::kCylinder, teeth + Vector3d(0, -1, 7), {22, 20, 5}, bone_in_tissue(0.6));  // upper
  body.go_on_with(kMandible);
  body.add(Kind::kCylinder, teeth + Vector3d(0, 1, -7), {24, 22, 5}, bone_in_tissue(0.65));  // lower
  body.go_on_with(kSkull);
  body.add(Kind::kCylinder, {body.vary(15, 0.4), -70, teeth.z() + 1}, {3, 3, 6}, bone_in_tissue(0.9));  // a crown
  body.end();
  body.add(Kind::kCylinder, body.near({0, -22, -78}, kPlacesMm), {9, 8, 22}, kAirInTissue);  // airway
  const Vector3d cervical = body.near({0, 24, -56}, kPlacesMm);
  const double pitch = body.vary(17, 0.1);
  for (int n = 0; n < 3; ++n) {
    const Vector3d at = cervical - Vector3d(0, 0, pitch * n);
    body.begin("C" + std::to_string(n + 1), at, at, true);
    body.add(Kind::kCylinder, at, {11, 9, 7}, bone_in_tissue(0.55));
    body.add(Kind::kBox, at + Vector3d(0, 26, -2), {4, 14, 4}, bone_in_tissue(0.5), tilt(15));
    body.add_grains(6, at, {9, 7, 5}, false);
  }
  return body;
}

Body spine(const Vector3d& center_patient_mm, std::uint64_t seed) {
  Body body(center_patient_mm, seed);
  body.add(Kind::kCylinder, {0, -30, 0}, {150, 95, 110}, kTissue);
  body.note_outline(20.0);
  body.add(Kind::kEllipsoid, {body.vary(60, 0.2), -60, 10}, {40, 22, 30}, {.water = -0.95, .bone = 0});  // bowel gas
  body.add(Kind::kEllipsoid, {body.vary(-45, 0.2), -75, -35}, {25, 14, 40}, {.water = -0.9, .bone = 0});
  constexpr int kVertebrae = 5, kMiddle = 2;
  const double pitch = body.vary(36, 0.1), lordosis = body.vary(6, 0.8), scoliosis = body.vary(3, 2.0);
  const double process = body.vary(36, 0.12), pedicle = body.vary(14, 0.12), facet = body.vary(17, 0.12);
  for (int n = 0; n < kVertebrae; ++n) {
    const double z = pitch * (n - kMiddle);
    const Vector3d at(body.vary(1.0, 1.0) + scoliosis * std::sin(0.7 * n), lordosis * std::cos(0.6 * n), z);
    const Vector3d half(body.vary(23, 0.06), body.vary(17, 0.06), body.vary(13, 0.06));
    body.begin("L" + std::to_string(kVertebrae - n), at, at, true);
    body.add(Kind::kCylinder, at, half, bone_in_tissue(0.25));
    body.add(Kind::kCylinder, at + Vector3d(0, 0, half.z()), {half.x(), half.y(), 1.2}, bone_in_tissue(0.5));
    body.add(Kind::kCylinder, at - Vector3d(0, 0, half.z()), {half.x(), half.y(), 1.2}, bone_in_tissue(0.5));
    body.add_grains(14, at, 0.85 * half, false);
    for (const double side : {-1.0, 1.0}) {
      body.add(Kind::kBox, at + Vector3d(side * pedicle, 22, 3), {4, 10, 7}, bone_in_tissue(0.6));       // pedicle
      body.add(Kind::kEllipsoid, at + Vector3d(side * facet, 33, -8), {8, 7, 12}, bone_in_tissue(0.5));  // facet
      body.add(Kind::kBox, at + Vector3d(side * process, 28, 2), {16, 4, 5}, bone_in_tissue(0.4), tilt(0, side * 12));
    }
    body.add(Kind::kBox, at + Vector3d(0, 50, -6), {3.5, 15, 10}, bone_in_tissue(0.5), tilt(20));  // spinous
  }
  for (const double side : {-1.0, 1.0}) {  // lowest ribs
    body.begin(std::string("rib ") + side_name(side), {side * 85, 22, 62}, {0, 0, 62});
    body.add(Kind::kCylinder, {side * body.vary(85, 0.1), 22, 62}, {4, 6, 52}, bone_in_tissue(0.5),
             tilt(0) * Eigen::AngleAxisd(side * 1.2, Vector3d::UnitY()).toRotationMatrix());
    body.begin(std::string("iliac wing ") + side_name(side), {side * 95, 10, -92}, {0, 0, -92});
    body.add(Kind::kEllipsoid, {side * body.vary(95, 0.06), 10, body.vary(-92, 0.06)}, {48, 14, 34},
             bone_in_tissue(0.3));  // iliac wing
  }
  return body;
}

// The target lies at 0 when it is not displaced; the middle of the body 65 mm to the left of it.
Body thorax(const Vector3d& target_patient_mm, std::uint64_t seed, const Vector3d& displacement_mm) {
  Body body(target_patient_mm, seed);
  constexpr double kMiddle = 65.0, kLungAir = 0.72;
  const Material lung{.water = -kLungAir, .bone = 0.0}, in_lung{.water = kLungAir, .bone = 0.0};
  body.add(Kind::kCylinder, {kMiddle, 10, 0}, {165, 112, 125}, kTissue);
  body.note_outline(12.0);
  for (const double side : {-1.0, 1.0})
    body.add(Kind::kEllipsoid, {kMiddle + side * body.vary(68, 0.03), body.vary(5, 0.5), 25}, {55, 82, 105}, lung);
  body.add(Kind::kEllipsoid, {kMiddle + 35, -25, 5}, {40, 42, 50}, in_lung);  // heart

  // The diaphragm's dome goes down with the target, and vessels near the target go with it.
  body.add(Kind::kEllipsoid, Vector3d(kMiddle - 68, 5, -95) + Vector3d(0, 0, displacement_mm.z()), {50, 70, 42},
           in_lung);
  body.add(Kind::kEllipsoid, Vector3d(kMiddle + 68, 5, -100) + Vector3d(0, 0, displacement_mm.z()), {48, 66, 40},
           in_lung);
  body.add(Kind::kEllipsoid, displacement_mm, {kTargetRadiusMm, 0.9 * kTargetRadiusMm, 0.8 * kTargetRadiusMm}, in_lung);
  body.add(Kind::kEllipsoid, displacement_mm + Vector3d(6, 4, 5), {9, 7, 8}, in_lung);
  for (int n = 0; n < 5; ++n) {
    const Vector3d at = body.near({0, 0, 0}, 9.0);
    body.add(Kind::kEllipsoid, displacement_mm + at, {1.8, 1.8, 1.8}, bone_in_tissue(0.8));
  }
  for (int n = 0; n < 14; ++n) {
    const Vector3d at = body.near({-5, 5, 15}, 45.0);
    body.add(Kind::kEllipsoid, at + body.vary(0.7, 0.3) * displacement_mm, {3, 3, body.vary(14, 0.5)}, in_lung,
             tilt(body.vary(30, 1.0), body.vary(40, 1.0)));
  }

  for (int n = -3; n <= 3; ++n) {  // spine
    const Vector3d at(kMiddle, 70, 28.0 * n);
    body.begin("T" + std::to_string(8 - n), at, at, true);
    body.add(Kind::kCylinder, at, {17, 14, 11}, bone_in_tissue(0.28));
    body.add_grains(5, at, {13, 11, 9}, false);
    body.add(Kind::kBox, at + Vector3d(0, 32, -6), {3, 12, 9}, bone_in_tissue(0.45), tilt(20));
    for (const double side : {-1.0, 1.0})
      body.add(Kind::kBox, at + Vector3d(side * 25, 18, 0), {12, 4, 5}, bone_in_tissue(0.4), tilt(0, side * 15));
  }
  // Ribs: pieces along ellipses that come forward and down; their front follows the breath a little.
  constexpr int kPieces = 9;
  for (int rib = -3; rib <= 3; ++rib)
    for (const double side : {-1.0, 1.0}) {
      // A rib hangs on the spine, so the spine's motion at its back end carries it whole.
      body.begin("rib " + std::to_string(8 - rib) + " " + side_name(side),
                 Vector3d(kMiddle + side * 138, 8, 30.0 * rib - 2.5), Vector3d(kMiddle, 70, 30.0 * rib + 20));
      for (int piece = 0; piece < kPieces; ++piece) {
        const double share = (piece + 0.5) / kPieces;  // from the back to the front
        const double angle = std::numbers::pi * (0.5 - 0.92 * share);
        const Vector3d at(kMiddle + side * 138 * std::cos(angle), 8 + 92 * std::sin(angle),
                          30.0 * rib + 20 - 45 * share);
        const Vector3d moved(side * 0.3 * displacement_mm.y() * share, 0.6 * displacement_mm.y() * share,
                             -0.15 * displacement_mm.z() * share);
        const double along_deg =
            std::atan2(92 * std::cos(angle), -side * 138 * std::sin(angle)) * 180.0 / std::numbers::pi;
        body.add(Kind::kEllipsoid, at + moved, {26, 4, 6.5}, bone_in_tissue(0.5), tilt(0, along_deg));
      }
    }
  return body;
}

// Of a thorax: clavicles, scapulae and the heads of the arms, each side one body that hangs on its clavicle's inner
// end.
Body shoulders(const Vector3d& target_patient_mm, std::uint64_t seed) {
  Body body(target_patient_mm, seed);
  constexpr double kMiddle = 65.0;
  for (const double side : {-1.0, 1.0}) {
    const auto there = [&](const Vector3d& at) { return Vector3d(kMiddle + side * at.x(), at.y(), at.z()); };
    body.begin(std::string("shoulder ") + side_name(side), there({90, 0, 75}), there({20, -70, 80}));
    body.add(Kind::kBox, there({72, -52, 88}), {50, 5, 5}, bone_in_tissue(0.6), tilt(0, side * 22));
    body.add(Kind::kBox, there({88, 78, 48}), {42, 3, 48}, bone_in_tissue(0.45), tilt(8, -side * body.vary(25, 0.2)));
    body.add(Kind::kBox, there({92, 70, 76}), {45, 6, 4}, bone_in_tissue(0.5),
             tilt(0, -side * 25));  // spine of scapula
    body.add(Kind::kEllipsoid, there({128, 8, 80}), {20, 20, 21}, bone_in_tissue(0.4));
  }
  return body;
}

}  // namespace

PhantomParts head_parts(const Vector3d& center_patient_mm, std::uint64_t seed) {
  return head(center_patient_mm, seed).take();
}
PhantomParts spine_parts(const Vector3d& center_patient_mm, std::uint64_t seed) {
  return spine(center_patient_mm, seed).take();
}
PhantomParts thorax_parts(const Vector3d& target_patient_mm, std::uint64_t seed, const Vector3d& displacement_mm) {
  return thorax(target_patient_mm, seed, displacement_mm).take();
}

PhantomParts ball_parts(const Vector3d& center_patient_mm, std::uint64_t seed) {
  constexpr int kBalls = 14;
  constexpr double kReachMm = 72.0, kRadiusMm = 3.0, kApartMm = 45.0;
  constexpr Material kAcrylic{.water = 1.1, .bone = 0.0}, kSteelInAcrylic{.water = -1.1, .bone = 6.0};
  PhantomParts parts;
  parts.shapes.push_back(make_shape(Kind::kBox, center_patient_mm, Vector3d::Constant(85.0), kAcrylic));
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> along(-kReachMm, kReachMm);
  std::vector<Vector3d> centers;
  while (centers.size() < kBalls) {
    const double x = along(random), y = along(random), z = along(random);
    const Vector3d next(x, y, z);
    const bool is_near =
        std::ranges::any_of(centers, [&](const Vector3d& other) { return (next - other).norm() < kApartMm; });
    if (!is_near) centers.push_back(next);
  }
  for (const Vector3d& center : centers)
    parts.shapes.push_back(
        make_shape(Kind::kEllipsoid, center_patient_mm + center, Vector3d::Constant(kRadiusMm), kSteelInAcrylic));
  return parts;
}

void add_shoulders(PhantomParts& thorax, const Vector3d& target_patient_mm, std::uint64_t seed) {
  const PhantomParts more = shoulders(target_patient_mm, seed).take();
  const int earlier = static_cast<int>(thorax.bodies.size());
  thorax.bodies.insert(thorax.bodies.end(), more.bodies.begin(), more.bodies.end());
  for (Shape shape : more.shapes) {
    shape.body += earlier;
    thorax.shapes.push_back(shape);
  }
}

std::vector<Vector3d> PhantomParts::vertebrae() const {
  std::vector<Vector3d> centers;
  for (const PhantomBody& body : bodies)
    if (body.is_vertebra) centers.push_back(body.center_patient_mm);
  return centers;
}

std::vector<Shape> head_phantom(const Vector3d& center_patient_mm, std::uint64_t seed) {
  return head_parts(center_patient_mm, seed).shapes;
}
std::vector<Shape> spine_phantom(const Vector3d& center_patient_mm, std::uint64_t seed) {
  return spine_parts(center_patient_mm, seed).shapes;
}
std::vector<Shape> thorax_phantom(const Vector3d& target_patient_mm, std::uint64_t seed,
                                  const Vector3d& displacement_mm) {
  return thorax_parts(target_patient_mm, seed, displacement_mm).shapes;
}

std::vector<Vector3d> head_vertebrae(const Vector3d& center_patient_mm, std::uint64_t seed) {
  return head_parts(center_patient_mm, seed).vertebrae();
}
std::vector<Vector3d> spine_vertebrae(const Vector3d& center_patient_mm, std::uint64_t seed) {
  return spine_parts(center_patient_mm, seed).vertebrae();
}
std::vector<Vector3d> thorax_vertebrae(const Vector3d& target_patient_mm, std::uint64_t seed) {
  return thorax_parts(target_patient_mm, seed, Vector3d::Zero()).vertebrae();
}

}  // namespace isoshift
