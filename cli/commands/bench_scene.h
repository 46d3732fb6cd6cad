#pragma once
// The scene of `isoshift bench`: volumes of the founding paper's sizes, a view, and the paper's poses.

#include <filesystem>
#include <string>
#include <vector>

#include "geometry/volume.h"
#include "geometry/xray_view.h"

namespace isoshift {

struct BenchVolume {
  std::string name;
  Volume<float> hu;
};

// A lumbar spine of 512 x 512 x 202 voxels, 53 MB in 8 bit like the paper's.
BenchVolume bench_spine();

// A head of 512 x 512 x 256 voxels, 67 MB in 8 bit like the paper's pig: the CT of the folder, interpolated to that
// size, or the phantom's head if the folder is empty.
BenchVolume bench_head(const std::filesystem::path& ct_folder);

// A square panel at SID 1500 mm, SAD 1000 mm, gantry 0: 333 mm wide at the isocenter. In some poses it does not show
// the corners of the volumes, but it always shows the whole body.
XrayView table1_view(int pixels, double panel_mm = 500.0);

// Rotations about the volume's center: -180 to 168 degrees in steps of 12 about three axes, 27,000 poses in all (Spoerk
// et al. 2012). Returns every `every`-th of them.
inline constexpr int kBenchPoses = 27000;
std::vector<Eigen::Isometry3d> bench_poses(const Volume<float>& volume, int every);

}  // namespace isoshift
