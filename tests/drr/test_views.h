#pragma once
// Views, volumes and poses that the renderers' tests share.

#include <vector>

#include "drr/renderer.h"
#include "phantom/shapes.h"

namespace isoshift {

inline constexpr std::array kBothBeams = {Beam::kKilovoltage, Beam::kMegavoltage};

// A square panel at SID 1500 mm (SAD 1000), centered, `pixels` along each edge.
XrayView centered_view(double gantry_deg, int pixels, double pixel_mm);

// A scan of rows along the room's y axis, centered, by a tube 570 mm from the isocenter, so many degrees
// beside the x axis. `pixel_mm` at the isocenter.
XrayView line_scan_view(int columns, int rows, double pixel_mm, double beside_x_deg = 20.0);

// A volume of one value, its center at the origin, its axes those of the room.
Volume<float> centered_volume(const Eigen::Vector3i& size, const Eigen::Vector3d& spacing_mm, float hu);

// Random HU between -700 and 1300 in 16 x 20 x 12 voxels with oblique axes.
Volume<float> textured_volume();

// Smooth everywhere, with slopes along all axes, and oblique; fades to air at its faces. With kAll everything of it
// attenuates: a threshold would make edges.
Volume<float> smooth_volume();
inline constexpr AttenuationModel kAll{.threshold_hu = -1001.0};

// The CT of shapes, and of the head phantom, with voxels of 1.5 x 1.5 x 2 mm about the origin.
Volume<float> phantom_ct_of(const std::vector<Shape>& shapes);
Volume<float> phantom_ct();

// Poses within 10 mm and 10 degrees, the same in every run.
std::vector<Eigen::Isometry3d> random_poses(int count);

double mean_of(const std::vector<float>& pixels);

// Pearson's correlation.
double correlation(const std::vector<float>& a, const std::vector<float>& b);

// A Gaussian blur of an image; sigma in pixels.
std::vector<float> blurred(const std::vector<float>& pixels, int columns, double sigma_px);

// rms(difference) / rms(oracle) over the pixels whose oracle value is not 0.
double relative_error(const std::vector<float>& pixels, const std::vector<float>& oracle);

}  // namespace isoshift
