#include "io/dicom/structure_mask.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/option_name.h"

namespace isoshift {
namespace {

// Contours are written with 1 to 4 decimals; what lies closer than this is in one plane.
constexpr double kPlaneToleranceMm = 0.1;
// A slice half-way between two planes belongs to the upper one, also where rounding says otherwise.
constexpr double kEdgeToleranceMm = 1e-3;

// The contours at one height: the coordinate along the normal of the slices.
struct Plane {
  double height_mm = 0.0;
  std::vector<const Contour*> contours;
};

std::string name_of(const Structure& structure) {
  return fmt::format("structure {} \"{}\"", structure.number, structure.name);
}

std::vector<Plane> planes_of(const Structure& structure, const Eigen::Vector3d& normal) {
  std::vector<Plane> single;
  for (const Contour& contour : structure.contours) {
    double lowest_mm = INFINITY, highest_mm = -INFINITY;
    for (const Eigen::Vector3d& point_mm : contour.points_patient_mm) {
      lowest_mm = std::min(lowest_mm, normal.dot(point_mm));
      highest_mm = std::max(highest_mm, normal.dot(point_mm));
    }
    if (!(highest_mm - lowest_mm <= kPlaneToleranceMm))
      throw Error(
          fmt::format("{}: a contour spans {:.2f} mm across the slices ({}), expected one parallel to them.\n"
                      "       Only structures drawn on the slices of the CT can be used",
                      name_of(structure), highest_mm - lowest_mm, described(DCM_ContourData)));
    single.push_back({0.5 * (lowest_mm + highest_mm), {&contour}});
  }
  std::ranges::stable_sort(single, {}, &Plane::height_mm);
  std::vector<Plane> planes;
  for (const Plane& plane : single) {
    if (planes.empty() || plane.height_mm - planes.back().height_mm > kPlaneToleranceMm)
      planes.push_back(plane);
    else
      planes.back().contours.push_back(plane.contours.front());
  }
  return planes;
}

// Plane n stands for the heights from edge n up to edge n + 1.
std::vector<double> slab_edges_mm(const std::vector<Plane>& planes, double slice_distance_mm) {
  std::vector<double> edges_mm = {0.0};
  double smallest_mm = INFINITY;
  for (std::size_t n = 1; n < planes.size(); ++n) {
    edges_mm.push_back(0.5 * (planes[n - 1].height_mm + planes[n].height_mm));
    smallest_mm = std::min(smallest_mm, planes[n].height_mm - planes[n - 1].height_mm);
  }
  const auto half_thickness_mm = [&](const Plane& plane) {
    const double thickness_mm = planes.size() > 1 ? smallest_mm : slice_distance_mm;
    return 0.5 * plane.contours.front()->slab_thickness_mm.value_or(thickness_mm);
  };
  edges_mm.front() = planes.front().height_mm - half_thickness_mm(planes.front());
  edges_mm.push_back(planes.back().height_mm + half_thickness_mm(planes.back()));
  return edges_mm;
}

// Marks, in every row that the edge from `a` to `b` crosses (both in voxels), the first voxel beyond the crossing: a
// second mark takes the first away. Horizontal edges cross none.
void mark_crossings(const Eigen::Vector3d& a, const Eigen::Vector3d& b, int k, Volume<std::uint8_t>& marks) {
  // From top to bottom, whichever way the edge was drawn: the two edges of a keyhole must cross at the same voxel.
  const Eigen::Vector3d& top = a.y() < b.y() ? a : b;
  const Eigen::Vector3d& bottom = a.y() < b.y() ? b : a;
  const int first = static_cast<int>(std::clamp<double>(std::ceil(top.y()), 0, marks.size.y()));
  const int end = static_cast<int>(std::clamp<double>(std::ceil(bottom.y()), 0, marks.size.y()));
  for (int j = first; j < end; ++j) {
    const double x = top.x() + (j - top.y()) / (bottom.y() - top.y()) * (bottom.x() - top.x());
    const int i = static_cast<int>(std::clamp<double>(std::ceil(x), 0, marks.size.x()));
    if (i < marks.size.x()) marks.at(i, j, k) ^= 1;
  }
}

// From marks to voxels inside: even-odd is the parity of the marks passed so far.
void fill_rows(int k, Volume<std::uint8_t>& mask) {
  for (int j = 0; j < mask.size.y(); ++j)
    for (int i = 1; i < mask.size.x(); ++i) mask.at(i, j, k) ^= mask.at(i - 1, j, k);
}

}  // namespace

Volume<std::uint8_t> mask_of(const Structure& structure, const Eigen::Vector3i& size,
                             const Eigen::Affine3d& patient_from_voxel) {
  const Eigen::Matrix3d& axes = patient_from_voxel.linear();
  const Eigen::Vector3d normal = axes.col(0).cross(axes.col(1)).normalized();
  const Eigen::Affine3d voxel_from_patient = patient_from_voxel.inverse();
  const std::vector<Plane> planes = planes_of(structure, normal);
  Volume<std::uint8_t> mask(size, patient_from_voxel);
  const std::vector<double> edges_mm =
      planes.empty() ? std::vector<double>() : slab_edges_mm(planes, std::abs(normal.dot(axes.col(2))));
  for (int k = 0; k < size.z(); ++k) {
    const double slice_height_mm = normal.dot(patient_from_voxel * Eigen::Vector3d(0, 0, k));
    const auto above = std::ranges::upper_bound(edges_mm, slice_height_mm + kEdgeToleranceMm);
    if (above == edges_mm.begin() || above == edges_mm.end()) continue;
    const Plane& plane = planes[static_cast<std::size_t>(above - edges_mm.begin()) - 1];
    // Along the normal from the plane to the slice: under a tilted gantry that is not along the stack of slices.
    const Eigen::Vector3d to_slice_mm = (slice_height_mm - plane.height_mm) * normal;
    for (const Contour* contour : plane.contours) {
      Eigen::Vector3d previous = voxel_from_patient * (contour->points_patient_mm.back() + to_slice_mm);
      for (const Eigen::Vector3d& point_mm : contour->points_patient_mm) {
        const Eigen::Vector3d point = voxel_from_patient * (point_mm + to_slice_mm);
        mark_crossings(previous, point, k, mask);
        previous = point;
      }
    }
    fill_rows(k, mask);
  }
  if (std::ranges::find(mask.voxels, std::uint8_t{1}) == mask.voxels.end())
    throw Error(
        fmt::format("{}: no voxel of the CT lies in it ({}): it is drawn outside of the CT, or is smaller than a "
                    "voxel. Name another structure, or the CT on which this one was drawn ({})",
                    name_of(structure), described(DCM_ContourData), option("ct", "FOLDER")));
  return mask;
}

}  // namespace isoshift
