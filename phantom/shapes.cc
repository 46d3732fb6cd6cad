#include "phantom/shapes.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/parallel.h"

namespace isoshift {
namespace {

// Cortical bone against water at about 70 keV, where a 120 kVp scanner is calibrated: 0.2599 * 1.92 / 0.1929, from the
// mass attenuation coefficients of NIST (XCOM; Hubbell and Seltzer, NISTIR 5632), interpolated.
constexpr double kBoneToWaterInCt = 2.59;

struct Interval {
  double begin = 0.0;
  double end = 1.0;
  void clip(double low, double high) {
    begin = std::max(begin, low);
    end = std::min(end, high);
  }
};

// Where source + t way lies between -1 and 1.
void clip_to_slab(double source, double way, Interval& t) {
  if (way == 0.0) {
    if (std::abs(source) > 1.0) t.clip(1.0, 0.0);
    return;
  }
  const double a = (-1.0 - source) / way;
  const double b = (1.0 - source) / way;
  t.clip(std::min(a, b), std::max(a, b));
}

// Where |source + t way| <= 1.
template <class Vector>
void clip_to_ball(const Vector& source, const Vector& way, Interval& t) {
  const double a = way.squaredNorm();
  const double b = source.dot(way);
  const double c = source.squaredNorm() - 1.0;
  if (a == 0.0) {
    if (c > 0.0) t.clip(1.0, 0.0);
    return;
  }
  const double discriminant = b * b - a * c;
  if (discriminant <= 0.0) return t.clip(1.0, 0.0);
  const double root = std::sqrt(discriminant);
  t.clip((-b - root) / a, (-b + root) / a);
}

}  // namespace

double Shape::chord_mm(const Eigen::Vector3d& begin_patient_mm, const Eigen::Vector3d& end_patient_mm) const {
  const Eigen::Vector3d source = unit_from_patient * begin_patient_mm;
  const Eigen::Vector3d way = unit_from_patient.linear() * (end_patient_mm - begin_patient_mm);
  Interval t;
  switch (kind) {
    case Kind::kEllipsoid: clip_to_ball(source, way, t); break;
    case Kind::kCylinder:
      clip_to_slab(source.z(), way.z(), t);
      clip_to_ball(Eigen::Vector2d(source.head<2>()), Eigen::Vector2d(way.head<2>()), t);
      break;
    case Kind::kBox:
      for (int axis = 0; axis < 3; ++axis) clip_to_slab(source[axis], way[axis], t);
      break;
  }
  return t.end > t.begin ? (t.end - t.begin) * (end_patient_mm - begin_patient_mm).norm() : 0.0;
}

bool Shape::contains(const Eigen::Vector3d& point_patient_mm) const {
  const Eigen::Vector3d u = unit_from_patient * point_patient_mm;
  switch (kind) {
    case Kind::kEllipsoid: return u.squaredNorm() <= 1.0;
    case Kind::kCylinder: return u.head<2>().squaredNorm() <= 1.0 && std::abs(u.z()) <= 1.0;
    case Kind::kBox: return u.cwiseAbs().maxCoeff() <= 1.0;
  }
  return false;
}

Shape make_shape(Shape::Kind kind, const Eigen::Vector3d& center_patient_mm, const Eigen::Vector3d& half_extent_mm,
                 const Material& added, const Eigen::Matrix3d& rotation) {
  Eigen::Affine3d patient_from_unit = Eigen::Affine3d::Identity();
  patient_from_unit.linear() = rotation * half_extent_mm.asDiagonal();
  patient_from_unit.translation() = center_patient_mm;
  return {.kind = kind, .unit_from_patient = patient_from_unit.inverse(), .added = added};
}

Volume<float> ct_of_shapes(const std::vector<Shape>& shapes, const Eigen::Vector3i& size,
                           const Eigen::Affine3d& patient_from_voxel) {
  Volume<float> ct(size, patient_from_voxel, -1000.0F);
  const Eigen::Affine3d voxel_from_patient = patient_from_voxel.inverse();
  for (const Shape& shape : shapes) {
    // The voxels that the shape can touch: the box around the eight corners of its unit cube.
    const Eigen::Affine3d voxel_from_unit = voxel_from_patient * shape.unit_from_patient.inverse();
    const Eigen::Vector3d reach = voxel_from_unit.linear().cwiseAbs().rowwise().sum();
    const Eigen::Vector3i low = (voxel_from_unit.translation() - reach).array().floor().cast<int>().max(0);
    const Eigen::Vector3i high =
        (voxel_from_unit.translation() + reach).array().ceil().cast<int>().min(size.array() - 1);
    const double hu = 1000.0 * (shape.added.water + kBoneToWaterInCt * shape.added.bone);
    parallel_for(low.z(), high.z() + 1, [&](int k) {
      for (int j = low.y(); j <= high.y(); ++j)
        for (int i = low.x(); i <= high.x(); ++i) {
          int inside = 0;
          for (int n = 0; n < 8; ++n) {
            const Eigen::Vector3d point(i + (n & 1 ? 0.25 : -0.25), j + (n & 2 ? 0.25 : -0.25),
                                        k + (n & 4 ? 0.25 : -0.25));
            inside += shape.contains(patient_from_voxel * point);
          }
          ct.at(i, j, k) += static_cast<float>(hu * inside / 8.0);
        }
    });
  }
  return ct;
}

}  // namespace isoshift
