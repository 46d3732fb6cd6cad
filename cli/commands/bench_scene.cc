#include "cli/commands/bench_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "geometry/rotation.h"
#include "io/dicom/ct_series.h"
#include "io/study/study_files.h"
#include "phantom/shapes.h"

namespace isoshift {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3i;

Eigen::Affine3d centered_lattice(const Vector3i& size, const Vector3d& spacing_mm) {
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
  patient_from_voxel.linear() = spacing_mm.asDiagonal();
  patient_from_voxel.translation() = -0.5 * spacing_mm.cwiseProduct((size.array() - 1).cast<double>().matrix());
  return patient_from_voxel;
}

// The same body in another number of voxels, interpolated trilinearly from first to last voxel center.
Volume<float> resampled(const Volume<float>& from, const Vector3i& size) {
  const Vector3d step = (from.size.array() - 1).cast<double>() / (size.array() - 1).cast<double>();
  Volume<float> to(size, from.patient_from_voxel * Eigen::Scaling(step));
  parallel_for(0, size.z(), [&](int k) {
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) {
        const Vector3d position = Vector3d(i, j, k).cwiseProduct(step);
        const Vector3i corner = position.cast<int>().cwiseMin((from.size.array() - 2).matrix()).cwiseMax(0);
        const Vector3d fraction = position - corner.cast<double>();
        double value = 0.0;
        for (int n = 0; n < 8; ++n) {
          const Vector3i offset(n & 1, (n >> 1) & 1, n >> 2);
          const Vector3i voxel = (corner + offset).cwiseMin((from.size.array() - 1).matrix());
          const double share = (1.0 - (fraction - offset.cast<double>()).cwiseAbs().array()).prod();
          value += share * from.at(voxel.x(), voxel.y(), voxel.z());
        }
        to.at(i, j, k) = static_cast<float>(value);
      }
  });
  return to;
}

}  // namespace

BenchVolume bench_spine() {
  const Vector3i size(512, 512, 202);
  return {"spine phantom",
          ct_of_shapes(spine_phantom(Vector3d::Zero(), 1), size, centered_lattice(size, Vector3d(0.6, 0.6, 1.0)))};
}

BenchVolume bench_head(const std::filesystem::path& ct_folder) {
  const Vector3i size(512, 512, 256);
  if (ct_folder.empty())
    return {"head phantom",
            ct_of_shapes(head_phantom(Vector3d::Zero(), 1), size, centered_lattice(size, Vector3d(0.45, 0.5, 0.9)))};
  const StudyFiles files = scan_study({ct_folder});
  if (files.cts.size() != 1)
    throw Error(fmt::format("{}: expected one CT series, found {}", ct_folder.string(), files.cts.size()));
  Notes notes;
  const CtSeries ct = read_ct_series(files.cts.front().files, {}, notes, [](std::size_t, std::size_t) {});
  return {"head CT", resampled(ct.hu, size)};
}

XrayView table1_view(int pixels, double panel_mm) {
  CarmGeometry geometry;
  geometry.sad_mm = 1000.0;
  geometry.receptor_translation_mm = Vector3d(0, 0, -500);
  geometry.column_spacing_mm = geometry.row_spacing_mm = panel_mm / pixels;
  geometry.position_mm = 0.5 * (pixels - 1) * geometry.row_spacing_mm * Eigen::Vector2d(-1, 1);
  geometry.columns = geometry.rows = pixels;
  return make_xray_view(geometry, Beam::kKilovoltage);
}

std::vector<Eigen::Isometry3d> bench_poses(const Volume<float>& volume, int every) {
  constexpr int kPerAxis = 30;
  static_assert(kPerAxis * kPerAxis * kPerAxis == kBenchPoses);
  const auto angle_rad = [](int n) { return rad_from_deg(-180.0 + 12.0 * (n % kPerAxis)); };
  std::vector<Eigen::Isometry3d> poses;
  for (int n = 0; n < kBenchPoses; n += every) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = rotation_from_zxy({angle_rad(n), angle_rad(n / kPerAxis), angle_rad(n / (kPerAxis * kPerAxis))});
    pose.translation() = -(pose.linear() * volume.center_mm());
    poses.push_back(pose);
  }
  return poses;
}

}  // namespace isoshift
