#include "phantom/xray_simulation.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "base/error.h"
#include "tests/support/pose_near.h"

namespace isoshift::xray_simulation_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

const std::array<Vector3d, 4> kMarkers = {{{20, 30, -390}, {-60, 50, -430}, {5, -10, -370}, {-25, 75, -395}}};

// Center of the shadow of a marker near a pixel, above what surrounds it.
Vector2d shadow_near(const Image<float>& intensity, const Vector2d& expected) {
  constexpr int kReach = 9;
  const int c = static_cast<int>(std::lround(expected.x())), r = static_cast<int>(std::lround(expected.y()));
  const double open = intensity.at(c - kReach, r - kReach);
  double weights = 0.0;
  Vector2d sum = Vector2d::Zero();
  for (int row = r - kReach; row <= r + kReach; ++row)
    for (int column = c - kReach; column <= c + kReach; ++column) {
      const double absorbed = std::max(0.0, 1.0 - intensity.at(column, row) / open - 0.002);
      weights += absorbed;
      sum += absorbed * Vector2d(column, row);
    }
  return sum / weights;
}

struct Case {
  const char* position;
  double gantry_deg, couch_deg;
  bool off_plan;
  std::array<Vector2d, 4> expected;
};

// Expected pixels by a separate program from the chain of docs/dicom.md 2.2 and 2.3: isocenter (-12.5, 38, -410), SAD
// 1000, SID 1500, 512 x 512 pixels of 0.8 mm, off plan by t = (4.3, -6.1, 3.2), R = Rz(1.8) Rx(1.4) Ry(-2.1).
const std::array<Case, 4> kCases = {{
    {"HFS", 0, 0, false, {{{316.9289, 217.6976}, {167.4936, 292.5553}, {289.9669, 176.7185}, {232.8987, 228.3785}}}},
    {"HFS", 90, 0, true, {{{230.4687, 226.9695}, {275.3227, 304.4870}, {154.6567, 192.1042}, {318.5172, 237.9056}}}},
    {"HFS", 30, 10, true, {{{296.0455, 217.1806}, {206.1350, 319.3788}, {223.2767, 185.5672}, {271.1442, 242.8422}}}},
    {"FFDL",
     315,
     350,
     true,
     {{{209.3368, 299.5541}, {349.2052, 234.8407}, {166.9957, 329.0081}, {326.9446, 304.5553}}}},
}};

TEST(XraySimulation, ProjectsFourMarkersWhereAnIndependentComputationDoes) {
  for (const Case& c : kCases) {
    Placement placement{.patient_position = c.position, .couch_angle_deg = c.couch_deg};
    placement.isocenter_patient_mm = Vector3d(-12.5, 38, -410);
    if (c.off_plan) {
      placement.translation_mm = Vector3d(4.3, -6.1, 3.2);
      placement.rotation_deg = Vector3d(1.4, -2.1, 1.8);
    }
    std::vector<Shape> markers;
    for (const Vector3d& at : kMarkers)
      markers.push_back(make_shape(Shape::Kind::kEllipsoid, at, Vector3d::Constant(1.5), {.bone = 8.0}));
    const Image<float> intensity = simulate_xray(markers, placement, {.gantry_angle_deg = c.gantry_deg}, 0.0, 1);
    for (std::size_t n = 0; n < kMarkers.size(); ++n)
      // A twentieth of a pixel: the shadow of a ball is a sampled ellipse.
      EXPECT_THAT(shadow_near(intensity, c.expected[n]), VectorNear(c.expected[n], 0.05))
          << c.position << ", gantry " << c.gantry_deg << ", marker " << n;
  }
}

TEST(XraySimulation, PlacementReadsBack) {
  Placement placement{.patient_position = "HFDR", .couch_angle_deg = 33};
  placement.isocenter_patient_mm = Vector3d(1, 2, 3);
  placement.translation_mm = Vector3d(4, 5, 6);
  placement.rotation_deg = Vector3d(7, 8, 9);
  const Vector3d point(30, -20, 50);
  EXPECT_THAT(placement.patient_from_fixed(placement.fixed_from_patient(point)), VectorNear(point, 1e-12));
  placement.patient_position = "SITTING";
  EXPECT_THROW(placement.fixed_from_patient(point), UsageError);
}

TEST(XraySimulation, BeamHardeningMakesThickWaterLookThinner) {
  const auto line_integral = [](double thickness_mm) {
    const Shape slab =
        make_shape(Shape::Kind::kBox, Vector3d::Zero(), Vector3d(300, thickness_mm / 2, 300), {.water = 1.0});
    const Image<float> image = simulate_xray({slab}, {}, {.pixels = 64, .pixel_mm = 0.5}, 0.0, 1);
    const Image<float> open = simulate_xray({}, {}, {.pixels = 64, .pixel_mm = 0.5}, 0.0, 1);
    return -std::log(image.at(32, 32) / open.at(32, 32));
  };
  const double thin = line_integral(10), thick = line_integral(200);
  EXPECT_LT(thick, 20 * thin);
  EXPECT_GT(thick, 15 * thin);
}

TEST(XraySimulation, SameSeedSameNoise) {
  const auto shot = [](std::uint64_t seed) { return simulate_xray({}, {}, {.pixels = 64}, 1000.0, seed).pixels; };
  EXPECT_EQ(shot(1), shot(1));
  EXPECT_NE(shot(1), shot(2));
}

TEST(Shapes, ChordsAreThoseOfGeometry) {
  const Vector3d begin(-100, 0, 0), end(100, 0, 0);
  const Vector3d half(10, 20, 30);
  EXPECT_DOUBLE_EQ(make_shape(Shape::Kind::kEllipsoid, Vector3d::Zero(), half, {}).chord_mm(begin, end), 20.0);
  EXPECT_DOUBLE_EQ(make_shape(Shape::Kind::kCylinder, Vector3d::Zero(), half, {}).chord_mm(begin, end), 20.0);
  EXPECT_DOUBLE_EQ(make_shape(Shape::Kind::kBox, Vector3d::Zero(), half, {}).chord_mm(begin, end), 20.0);
  EXPECT_EQ(make_shape(Shape::Kind::kBox, Vector3d(0, 21, 0), half, {}).chord_mm(begin, end), 0.0);
  // Off center: the chord of a circle of radius 10 at distance 6.
  EXPECT_NEAR(make_shape(Shape::Kind::kCylinder, Vector3d(0, 6, 0), Vector3d(10, 10, 5), {}).chord_mm(begin, end), 16.0,
              1e-12);
}

TEST(Shapes, CtHoldsWaterAndBone) {
  const auto slab = [](const Material& material) {
    return make_shape(Shape::Kind::kBox, Vector3d::Zero(), Vector3d::Constant(50), material);
  };
  const Volume<float> ct =
      ct_of_shapes({slab({.water = 1.0}), slab({.water = -0.5, .bone = 0.5})}, {3, 3, 3}, Eigen::Affine3d::Identity());
  EXPECT_FLOAT_EQ(ct.at(1, 1, 1), 1000.0F * (0.5F + 2.59F * 0.5F) - 1000.0F);
}

}  // namespace
}  // namespace isoshift::xray_simulation_test
