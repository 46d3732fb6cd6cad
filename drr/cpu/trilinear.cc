#include "drr/cpu/trilinear.h"

#include <algorithm>

#include "base/parallel.h"
#include "drr/cpu/cell_walk.h"
#include "drr/interpolation.h"
#include "drr/of_beam.h"

namespace isoshift {
namespace {

// The gradient of interpolate() there, per voxel.
Eigen::Vector3d interpolated_gradient(const Volume<float>& volume, const Eigen::Vector3i& corner,
                                      const Eigen::Vector3d& fraction) {
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  for (int n = 0; n < 8; ++n) {
    const Eigen::Vector3i offset(n & 1, (n >> 1) & 1, n >> 2);
    const Eigen::Vector3d weight = 1.0 - (fraction - offset.cast<double>()).cwiseAbs().array();
    const Eigen::Vector3d sign = 2.0 * offset.cast<double>().array() - 1.0;
    gradient += voxel_or_zero(volume, corner + offset) * Eigen::Vector3d(sign.x() * weight.y() * weight.z(),
                                                                         sign.y() * weight.x() * weight.z(),
                                                                         sign.z() * weight.x() * weight.y());
  }
  return gradient;
}

// Calls visit(corner, fraction, t, weight) at the Gauss points of all cells that the ray passes: an integral over t is
// the sum of the values there, times their weights.
template <class Visit>
void visit_points(const VoxelRay& ray, const Eigen::Vector3i& size, Visit&& visit) {
  constexpr double kGaussOffset = 0.28867513459481287;  // 1 / (2 sqrt 3)
  // Cells lie between voxel centers, one more on each side for the way down to zero: cell c spans voxels c-1 and c.
  VoxelRay cell_ray = ray;
  cell_ray.source.array() += 1.0;
  const Eigen::Vector3i cells = size.array() + 1;
  walk_cells(cell_ray, cells, [&](const Eigen::Vector3i& cell, double begin, double end) {
    const double middle = 0.5 * (begin + end);
    const double offset = kGaussOffset * (end - begin);
    for (const double t : {middle - offset, middle + offset}) {
      const Eigen::Vector3d fraction = cell_ray.source + t * cell_ray.way - cell.cast<double>();
      visit(Eigen::Vector3i(cell.array() - 1), fraction, t, 0.5 * (end - begin));
    }
  });
}

// Of attenuation that a function gives for every voxel of that size, and for those beside it.
template <class VoxelAt>
double line_integral(const VoxelRay& ray, const Eigen::Vector3i& size, VoxelAt&& voxel_at) {
  double sum = 0.0;
  visit_points(ray, size, [&](const Eigen::Vector3i& corner, const Eigen::Vector3d& fraction, double, double weight) {
    sum += weight * interpolate_between(voxel_at, corner, fraction);
  });
  return sum * ray.length_mm;
}

// Along a line the gradient is a quadratic polynomial in every cell, and t times it a cubic one: exact, too.
RayGradient gradient_of(const VoxelRay& ray, const Volume<float>& volume) {
  RayGradient sum;
  visit_points(ray, volume.size,
               [&](const Eigen::Vector3i& corner, const Eigen::Vector3d& fraction, double t, double weight) {
                 const Eigen::Vector3d part = ray.length_mm * weight * interpolated_gradient(volume, corner, fraction);
                 sum.by_source += part;
                 sum.by_way += t * part;
               });
  return sum;
}

}  // namespace

TrilinearRenderer::TrilinearRenderer(const Volume<float>& ct_hu, const AttenuationModel& model,
                                     std::span<const Beam> beams)
    : CpuRenderer(ct_hu.patient_from_voxel) {
  for (const Beam beam : beams) attenuation_per_mm_.emplace(beam, attenuation_volume(ct_hu, model, beam));
}

TrilinearRenderer::TrilinearRenderer(AttenuationByBeam attenuation_per_mm)
    : CpuRenderer(lattice_of(attenuation_per_mm)), attenuation_per_mm_(std::move(attenuation_per_mm)) {}

void TrilinearRenderer::integrate(std::span<const VoxelRay> rays, Beam beam, std::span<float> line_integrals,
                                  std::span<RayGradient> gradients) const {
  const Volume<float>& volume = of_beam(attenuation_per_mm_, beam);
  const auto voxel_at = [&](const Eigen::Vector3i& at) { return voxel_or_zero(volume, at); };
  std::ranges::transform(rays, line_integrals.begin(), [&](const VoxelRay& ray) {
    return static_cast<float>(line_integral(ray, volume.size, voxel_at));
  });
  for (std::size_t n = 0; n < gradients.size(); ++n) gradients[n] = gradient_of(rays[n], volume);
}

std::vector<double> exact_line_integrals(const Volume<float>& ct_hu, const AttenuationModel& model,
                                         const XrayView& view, const Eigen::Isometry3d& room_from_patient,
                                         std::span<const std::uint32_t> pixels) {
  const Camera camera = make_camera(view, room_from_patient, ct_hu.patient_from_voxel.inverse());
  const Eigen::Matrix3d mm_from_voxel_axes = ct_hu.patient_from_voxel.linear();
  const auto voxel_at = [&](const Eigen::Vector3i& at) -> double {
    const bool inside = (at.array() >= 0).all() && (at.array() < ct_hu.size.array()).all();
    return inside ? model.attenuation_per_mm(ct_hu.at(at.x(), at.y(), at.z()), view.beam) : 0.0F;
  };
  std::vector<double> line_integrals(pixels.size());
  parallel_for(std::size_t{0}, pixels.size(), [&](std::size_t n) {
    const int pixel = static_cast<int>(pixels[n]);
    const VoxelRay ray = ray_to(pixel % view.columns, pixel / view.columns, camera, mm_from_voxel_axes);
    line_integrals[n] = line_integral(ray, ct_hu.size, voxel_at);
  });
  return line_integrals;
}

}  // namespace isoshift
