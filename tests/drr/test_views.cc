#include "tests/drr/test_views.h"

#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <random>

#include "geometry/rotation.h"

namespace isoshift {

XrayView centered_view(double gantry_deg, int pixels, double pixel_mm) {
  CarmGeometry geometry;
  geometry.sad_mm = 1000.0;
  geometry.gantry_angle_rad = rad_from_deg(gantry_deg);
  geometry.receptor_translation_mm = Eigen::Vector3d(0, 0, -500);
  geometry.column_spacing_mm = geometry.row_spacing_mm = pixel_mm;
  geometry.position_mm = 0.5 * (pixels - 1) * pixel_mm * Eigen::Vector2d(-1, 1);
  geometry.columns = geometry.rows = pixels;
  return make_xray_view(geometry, Beam::kKilovoltage);
}

XrayView line_scan_view(int columns, int rows, double pixel_mm, double beside_x_deg) {
  const Eigen::Matrix3d turned = rotation_y(rad_from_deg(beside_x_deg));
  const Eigen::Vector3d across = turned * Eigen::Vector3d::UnitZ(), along = Eigen::Vector3d::UnitY();
  const Eigen::Vector3d first_row = -0.5 * (rows - 1) * pixel_mm * along;
  return make_line_scan_view({.source_room_mm = 570.0 * (turned * Eigen::Vector3d::UnitX()) + first_row,
                              .first_pixel_room_mm = first_row - 0.5 * (columns - 1) * pixel_mm * across,
                              .column_step_room_mm = pixel_mm * across,
                              .row_step_room_mm = pixel_mm * along,
                              .sid_by_sad = 1040.0 / 570.0,
                              .columns = columns,
                              .rows = rows},
                             Beam::kKilovoltage);
}

Volume<float> centered_volume(const Eigen::Vector3i& size, const Eigen::Vector3d& spacing_mm, float hu) {
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
  patient_from_voxel.linear() = spacing_mm.asDiagonal();
  patient_from_voxel.translation() = -0.5 * Eigen::Vector3d((size.array() - 1).cast<double>() * spacing_mm.array());
  return {size, patient_from_voxel, hu};
}

Volume<float> textured_volume() {
  Volume<float> ct = centered_volume({16, 20, 12}, {3.0, 2.5, 4.0}, 0.0F);
  ct.patient_from_voxel = Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized()) * ct.patient_from_voxel;
  std::mt19937 random(3);
  for (float& hu : ct.voxels) hu = std::uniform_real_distribution<float>(-700, 1300)(random);
  return ct;
}

Volume<float> smooth_volume() {
  constexpr double kSpacingMm = 2.0, kWaveMm = 35.0;
  const Eigen::Vector3i size(56, 62, 48);
  Volume<float> ct = centered_volume(size, Eigen::Vector3d::Constant(kSpacingMm), 0.0F);
  ct.patient_from_voxel = Eigen::Affine3d(Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, -1).normalized()) *
                                          Eigen::Translation3d(3.0, -5.0, 2.0)) *
                          ct.patient_from_voxel;
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) {
        const Eigen::Vector3d share = Eigen::Vector3d(i, j, k).array() / (size.cast<double>().array() - 1.0);
        const double fade = (4.0 * share.array() * (1.0 - share.array())).prod();
        const Eigen::Vector3d phase = 2.0 * M_PI * kSpacingMm / kWaveMm * Eigen::Vector3d(i, j, k);
        const double wave = std::sin(phase.x()) * std::cos(phase.y()) + std::sin(phase.z() + phase.x());
        ct.at(i, j, k) = static_cast<float>(-1000.0 + fade * (1000.0 + 300.0 * wave));
      }
  return ct;
}

Volume<float> phantom_ct_of(const std::vector<Shape>& shapes) {
  const Volume<float> lattice = centered_volume({127, 154, 108}, {1.5, 1.5, 2.0}, 0.0F);
  return ct_of_shapes(shapes, lattice.size, lattice.patient_from_voxel);
}

Volume<float> phantom_ct() { return phantom_ct_of(head_phantom(Eigen::Vector3d::Zero(), 1)); }

std::vector<Eigen::Isometry3d> random_poses(int count) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> within(-1.0, 1.0);
  std::vector<Eigen::Isometry3d> poses;
  for (int n = 0; n < count; ++n) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = rotation_from_zxy({0.17 * within(random), 0.17 * within(random), 0.17 * within(random)});
    pose.translation() = 10.0 * Eigen::Vector3d(within(random), within(random), within(random));
    poses.push_back(pose);
  }
  return poses;
}

double mean_of(const std::vector<float>& pixels) {
  return std::accumulate(pixels.begin(), pixels.end(), 0.0) / static_cast<double>(pixels.size());
}

double correlation(const std::vector<float>& a, const std::vector<float>& b) {
  const double mean_a = mean_of(a), mean_b = mean_of(b);
  double ab = 0.0, aa = 0.0, bb = 0.0;
  for (std::size_t n = 0; n < a.size(); ++n) {
    ab += (a[n] - mean_a) * (b[n] - mean_b);
    aa += std::pow(a[n] - mean_a, 2);
    bb += std::pow(b[n] - mean_b, 2);
  }
  return ab / std::sqrt(aa * bb);
}

std::vector<float> blurred(const std::vector<float>& pixels, int columns, double sigma_px) {
  const cv::Mat image(static_cast<int>(pixels.size()) / columns, columns, CV_32F, const_cast<float*>(pixels.data()));
  std::vector<float> result(pixels.size());
  cv::Mat into(image.rows, image.cols, CV_32F, result.data());
  cv::GaussianBlur(image, into, cv::Size(0, 0), sigma_px);
  return result;
}

double relative_error(const std::vector<float>& pixels, const std::vector<float>& oracle) {
  double difference = 0.0, reference = 0.0;
  for (std::size_t n = 0; n < oracle.size(); ++n) {
    if (oracle[n] == 0.0F) continue;
    difference += std::pow(pixels[n] - oracle[n], 2);
    reference += std::pow(oracle[n], 2);
  }
  return std::sqrt(difference / reference);
}

}  // namespace isoshift
