#pragma once
// CTs of phantoms on any lattice, and where their vertebrae are.

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "phantom/anatomy.h"

namespace isoshift {

struct PhantomCt {
  std::string anatomy;  // "head", "spine" or "thorax"
  std::uint64_t seed = 1;
  Eigen::Vector3d spacing_mm{2.0, 2.0, 2.0};
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();  // of the voxels, in patient coordinates
  double noise_hu = 20.0;
  double curve_mm = 0.0;  // of a scoliosis: the spine is bent sideways by as much
  bool has_screws = false;
  bool has_shoulders = false;                            // of a thorax
  Eigen::Vector3d cropped_mm = Eigen::Vector3d::Zero();  // from the extent, about its middle
  Eigen::Vector3d shifted_mm = Eigen::Vector3d::Zero();  // the middle of the extent

  static Eigen::Vector3d center() { return {3.0, -8.0, 21.0}; }

  std::vector<Shape> shapes() const {
    if (anatomy == "head") return head_phantom(center(), seed);
    if (anatomy == "spine") return spine_phantom(center(), seed);
    PhantomParts thorax = thorax_parts(center(), seed, Eigen::Vector3d::Zero());
    if (has_shoulders) add_shoulders(thorax, center(), seed);
    return thorax.shapes;
  }
  double aside_mm(double z) const { return curve_mm * std::sin(0.02 * (z - center().z())); }

  std::vector<Eigen::Vector3d> vertebrae() const {
    auto centers = anatomy == "head"    ? head_vertebrae(center(), seed)
                   : anatomy == "spine" ? spine_vertebrae(center(), seed)
                                        : thorax_vertebrae(center(), seed);
    for (Eigen::Vector3d& at : centers) at.x() += aside_mm(at.z());
    return centers;
  }

  Volume<float> make() const {
    const Eigen::Vector3d extent = anatomy == "head"    ? Eigen::Vector3d(190, 230, 216)
                                   : anatomy == "spine" ? Eigen::Vector3d(320, 220, 180)
                                                        : Eigen::Vector3d(350, 250, 210);
    const Eigen::Vector3d from_center = anatomy == "head"    ? Eigen::Vector3d(0, 0, 4)
                                        : anatomy == "spine" ? Eigen::Vector3d(0, -25, 0)
                                                             : Eigen::Vector3d(65, 10, 0);
    const Eigen::Array3d along = (axes.transpose() * (extent - cropped_mm)).cwiseAbs().array();
    const Eigen::Vector3i size = (along / spacing_mm.array()).round().cast<int>();
    Eigen::Affine3d lattice = Eigen::Affine3d::Identity();
    lattice.linear() = axes * spacing_mm.asDiagonal();
    lattice.translation() =
        center() + from_center + shifted_mm - 0.5 * (lattice.linear() * (size.array() - 1).cast<double>().matrix());
    std::vector<Shape> all = shapes();
    for (Shape& shape : all) {  // whole shapes move aside
      const Eigen::Vector3d at = shape.unit_from_patient.inverse().translation();
      shape.unit_from_patient = shape.unit_from_patient * Eigen::Translation3d(-aside_mm(at.z()), 0.0, 0.0);
    }
    if (has_screws)
      for (const Eigen::Vector3d& at : vertebrae())
        for (const double side : {-1.0, 1.0})
          all.push_back(make_shape(Shape::Kind::kBox, at + Eigen::Vector3d(side * 14.0, 15.0, 2.0), {2.0, 20.0, 2.0},
                                   {.water = -1.0, .bone = 4.0}));
    Volume<float> ct = ct_of_shapes(all, size, lattice);
    std::mt19937_64 random(seed);
    std::normal_distribution<float> noise(0.0F, 1.0F);
    for (float& hu : ct.voxels) hu += static_cast<float>(noise_hu) * noise(random);
    return ct;
  }
};

}  // namespace isoshift
