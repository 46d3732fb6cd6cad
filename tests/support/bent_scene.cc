#include "tests/support/bent_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "geometry/patient_setup.h"
#include "geometry/rotation.h"
#include "tests/drr/test_views.h"

namespace isoshift {
namespace {

constexpr double kPitchMm = 36.0;

// A block of bone with processes that differ from group to group, within 14 mm of its height.
std::vector<Shape> vertebra(double z, std::uint64_t seed) {
  using Kind = Shape::Kind;
  using Eigen::Vector3d;
  constexpr Material kBone{.water = 0.4, .bone = 0.5}, kTissue{.water = 0.8};
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> vary(-1.0, 1.0);
  const auto turned = [&] {
    return Eigen::AngleAxisd(0.5 * vary(random), Vector3d(vary(random), vary(random), 1.0).normalized())
        .toRotationMatrix();
  };
  std::vector<Shape> shapes = {
      make_shape(Kind::kCylinder, {0, 0, z}, {45, 45, 14}, kTissue),
      make_shape(Kind::kCylinder, {2.0 * vary(random), -8, z}, {21, 16, 11 + vary(random)}, kBone)};
  for (const double side : {-1.0, 1.0}) {
    shapes.push_back(make_shape(Kind::kBox, {side * (26 + 4 * vary(random)), 14, z + 4 * vary(random)}, {11, 4, 5},
                                kBone, turned()));
    shapes.push_back(make_shape(Kind::kEllipsoid, {side * 15, 20 + 3 * vary(random), z - 3}, {6, 7, 8}, kBone));
  }
  shapes.push_back(make_shape(Kind::kBox, {3 * vary(random), 32, z + 3 * vary(random)}, {4, 10, 7}, kBone, turned()));
  return shapes;
}

}  // namespace

RenderedBodies rendered_bodies(const BentScene& scene, const JointedBodies& bodies) {
  constexpr std::array kOneBeam = {Beam::kKilovoltage};
  return {.apart = BodyRenderers(RendererKind::kCpu, scene.ct, {}, kOneBeam, bodies.shares),
          .as_one = make_renderer(RendererKind::kCpu, scene.ct, {}, kOneBeam)};
}

SearchableScene::SearchableScene(const BentScene& scene, const JointedBodies& bodies,
                                 const Eigen::Isometry3d& whole_room_from_patient)
    : rendered_(rendered_bodies(scene, bodies)),
      views_(scene.views()),
      scene_{.bodies = bodies,
             .fine = rendered_,
             .coarse = rendered_,
             .views = views_,
             .whole_room_from_patient = whole_room_from_patient} {}

std::vector<BodyShare> slabs(const Volume<float>& ct, const std::vector<double>& limits_mm, double soft_mm) {
  std::vector<BodyShare> shares(limits_mm.size() + 1, BodyShare(ct.size, ct.patient_from_voxel));
  for (int k = 0; k < ct.size.z(); ++k)
    for (int j = 0; j < ct.size.y(); ++j)
      for (int i = 0; i < ct.size.x(); ++i) {
        const double z = (ct.patient_from_voxel * Eigen::Vector3d(i, j, k)).z();
        int left = 255;
        for (std::size_t n = 0; n < limits_mm.size(); ++n) {
          const double above = std::clamp((z - limits_mm[n]) / soft_mm + 0.5, 0.0, 1.0);
          const int below = static_cast<int>(std::lround(255.0 * (1.0 - above)));
          const int own = std::max(0, below - (255 - left));
          shares[n].at(i, j, k) = static_cast<std::uint8_t>(own);
          left -= own;
        }
        shares.back().at(i, j, k) = static_cast<std::uint8_t>(left);
      }
  return shares;
}

BentScene bent_column(const std::vector<MovedGroup>& groups) {
  BentScene scene;
  scene.planned = planned_room_from_patient(PatientPosition::kHfs, {}, Eigen::Vector3d::Zero());
  const double lowest = -0.5 * kPitchMm * static_cast<double>(groups.size() - 1);
  std::vector<Shape> all;
  std::vector<XrayImage> xrays;
  std::vector<double> limits_mm;
  for (std::size_t n = 0; n < groups.size(); ++n) {
    const double z = lowest + kPitchMm * static_cast<double>(n);
    SceneOptions options{.shapes = vertebra(z, 50 + n), .pixels = 128};
    options.placement.translation_mm = groups[n].translation_mm;
    options.placement.rotation_deg = groups[n].rotation_deg;
    Eigen::Isometry3d& truth = scene.truth.emplace_back(Eigen::Isometry3d::Identity());
    truth.linear() = options.placement.rotation();
    truth.translation() = options.placement.translation_mm;
    const std::vector<XrayImage> own = xrays_of(options);
    if (xrays.empty())
      xrays = own;
    else
      for (std::size_t view = 0; view < xrays.size(); ++view)
        std::ranges::transform(xrays[view].values.pixels, own[view].values.pixels, xrays[view].values.pixels.begin(),
                               std::multiplies());
    all.insert(all.end(), options.shapes.begin(), options.shapes.end());
    if (n > 0) limits_mm.push_back(z - 0.5 * kPitchMm);
    scene.bodies.bodies.push_back({.name = std::to_string(n), .breathes = false});
    if (n > 0)
      scene.bodies.springs.push_back({.a = n - 1,
                                      .b = n,
                                      .at_patient_mm = {0.0, 0.0, z - 0.5 * kPitchMm},
                                      .sigma_mm = 2.0,
                                      .sigma_rad = rad_from_deg(4.0)});
  }
  for (const XrayImage& xray : xrays) scene.images.push_back(prepare(xray));
  const double length_mm = kPitchMm * static_cast<double>(groups.size()) + 10.0;
  const Volume<float> lattice =
      centered_volume({60, 60, static_cast<int>(length_mm / 2.0)}, Eigen::Vector3d::Constant(2.0), 0.0F);
  scene.ct = ct_of_shapes(all, lattice.size, lattice.patient_from_voxel);
  scene.bodies.shares = slabs(scene.ct, limits_mm, 12.0);
  return scene;
}

}  // namespace isoshift
