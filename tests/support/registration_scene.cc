#include "tests/support/registration_scene.h"

#include "geometry/patient_setup.h"
#include "geometry/rotation.h"
#include "tests/drr/test_views.h"

namespace isoshift {

std::vector<XrayImage> xrays_of(const SceneOptions& options) {
  std::vector<XrayImage> xrays;
  for (const double gantry_deg : options.gantry_angles_deg) {
    const Imager imager{.gantry_angle_deg = gantry_deg, .pixels = options.pixels, .pixel_mm = 300.0 / options.pixels};
    XrayImage xray;
    xray.view = centered_view(gantry_deg, imager.pixels, imager.pixel_mm);
    xray.values = simulate_xray(options.shapes, options.placement, imager, options.photons,
                                options.seed + 1000 * static_cast<std::uint64_t>(gantry_deg));
    xrays.push_back(std::move(xray));
  }
  return xrays;
}

RegistrationScene make_scene(const SceneOptions& options) {
  RegistrationScene scene;
  scene.xrays = xrays_of(options);
  for (const XrayImage& xray : scene.xrays) scene.images.push_back(prepare(xray));
  scene.planned = planned_room_from_patient(PatientPosition::kHfs, {}, Eigen::Vector3d::Zero());
  scene.truth.linear() = options.placement.rotation();
  scene.truth.translation() = options.placement.translation_mm;
  const Eigen::Vector3i size = (options.ct_mm / options.voxel_mm).array().round().cast<int>();
  const Volume<float> lattice = centered_volume(size, Eigen::Vector3d::Constant(options.voxel_mm), 0.0F);
  scene.ct = ct_of_shapes(options.shapes, lattice.size, lattice.patient_from_voxel);
  scene.renderers = std::make_unique<RendererPyramid>(RendererKind::kCpu, scene.ct, AttenuationModel{}, kBothBeams);
  return scene;
}

Stage fine_stage() {
  return {.name = "fine",
          .similarity = SimilarityKind::kGradientCorrelation,
          .pixel_mm = 2.2,
          .voxel_mm = 2.5,
          .initial_step_mm = 0.5,
          .initial_step_rad = rad_from_deg(0.4),
          .relative_tolerance = 0.05};
}

std::vector<Shape> asymmetric_body() {
  using Kind = Shape::Kind;
  using Eigen::Vector3d;
  constexpr Material kTissue{.water = 1.0}, kAir{.water = -0.95}, kBone{.water = -0.7, .bone = 0.7};
  const auto turned = [](double deg, const Vector3d& about) {
    return Eigen::AngleAxisd(deg * M_PI / 180.0, about.normalized()).toRotationMatrix();
  };
  return {make_shape(Kind::kEllipsoid, {0, 0, 0}, {72, 60, 75}, kTissue),
          make_shape(Kind::kEllipsoid, {-30, 10, 25}, {14, 9, 20}, kBone, turned(30, {1, 0, 1})),
          make_shape(Kind::kBox, {25, -15, 30}, {9, 14, 6}, kBone, turned(20, {0, 1, 1})),
          make_shape(Kind::kCylinder, {10, 25, -20}, {10, 8, 30}, kBone, turned(15, {1, 1, 0})),
          make_shape(Kind::kEllipsoid, {-25, -20, -35}, {18, 10, 8}, kBone),
          make_shape(Kind::kBox, {40, 5, -10}, {5, 12, 16}, kBone, turned(-25, {1, 0, 0})),
          make_shape(Kind::kEllipsoid, {5, -30, 5}, {12, 10, 9}, kAir),
          make_shape(Kind::kEllipsoid, {-45, 0, -8}, {8, 14, 7}, kAir),
          make_shape(Kind::kCylinder, {-5, 5, 50}, {6, 6, 12}, kBone, turned(60, {0, 1, 0})),
          make_shape(Kind::kBox, {20, 30, 45}, {7, 4, 9}, kBone, turned(45, {1, 1, 1}))};
}

}  // namespace isoshift
