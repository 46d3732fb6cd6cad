#pragma once
// What a registration needs, small and quick: X-rays of shapes by ray-shape intersections on one side, their CT and the
// program's own geometry on the other.

#include <memory>
#include <vector>

#include "drr/renderer_pyramid.h"
#include "geometry/xray_image.h"
#include "phantom/xray_simulation.h"
#include "registration/search.h"

namespace isoshift {

struct RegistrationScene {
  std::vector<XrayImage> xrays;
  std::vector<FixedImage> images;  // prepared
  Volume<float> ct;
  Eigen::Isometry3d planned = Eigen::Isometry3d::Identity();  // room from patient, HFS
  Eigen::Isometry3d truth = Eigen::Isometry3d::Identity();    // the setup error
  std::unique_ptr<RendererPyramid> renderers;

  Eigen::Isometry3d actual() const { return truth * planned; }
  FixedViews views() const { return {.images = images, .region = everything}; }

  ProjectedRegion everything;
};

struct SceneOptions {
  std::vector<Shape> shapes;
  Placement placement;  // the setup error in it; HFS, isocenter at the patient's origin
  std::vector<double> gantry_angles_deg = {0.0, 90.0};
  int pixels = 96;  // along the edges of a panel of 300 mm: 200 mm at the isocenter
  double photons = 0.0;
  std::uint64_t seed = 1;  // of the noise
  double voxel_mm = 2.5;   // of a CT of 170 mm along every edge
  Eigen::Vector3d ct_mm = Eigen::Vector3d::Constant(170.0);
};
RegistrationScene make_scene(const SceneOptions& options);

// A last stage for such a scene.
Stage fine_stage();

// X-rays as a SceneOptions says, without the rest.
std::vector<XrayImage> xrays_of(const SceneOptions& options);

// Ten bodies of bone and air in soft tissue, like no mirror image or turn of themselves; within 75 mm of the isocenter.
std::vector<Shape> asymmetric_body();

}  // namespace isoshift
