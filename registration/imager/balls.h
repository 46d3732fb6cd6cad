#pragma once
// Metal balls in a CT and in its X-rays: points that both know to a fraction of a pixel.

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "geometry/image.h"
#include "geometry/volume.h"
#include "geometry/xray_image.h"

namespace isoshift {

struct Ball {
  Eigen::Vector3d center_patient_mm = Eigen::Vector3d::Zero();
  double radius_mm = 0.0;
};

// Parts of the CT that are denser than half of its densest voxel, as large along all axes, and of 1 to 10 mm radius.
// Throws Error if there is no such part, or if other parts are as dense.
std::vector<Ball> balls_in(const Volume<float>& hu);

struct DarkSpots {
  std::vector<Eigen::Vector2d> places;  // (column, row)
  Image<std::uint8_t> field;            // of the X-ray's size; not 0: irradiated and not clipped
};

// Places in the irradiated field where an X-ray is darker than around, in a round spot of that radius: centers of mass
// of the line integrals above those around the spot. Throws Error for a blank X-ray.
DarkSpots dark_spots(const XrayImage& xray, double radius_px);

}  // namespace isoshift
