#pragma once
// What a person looks at to see whether a CT matches its scout.

#include <array>
#include <span>

#include "drr/renderer.h"
#include "io/report/canvas.h"
#include "registration/preprocess/preprocess.h"
#include "setup/view_picture.h"

namespace isoshift {

// The part of a scout that shows the corners of the CT, at full resolution, beside the CT rendered at two poses: where
// its files say (drr_planned) and where it was found (drr_found). What was not compared is dimmed.
ViewPicture scout_picture(const FixedImage& compared, Renderer& renderer, double pixel_mm,
                          const std::array<Eigen::Isometry3d, 2>& room_from_patient,
                          std::span<const Eigen::Vector3d> ct_corners_patient_mm);

// Squares of both by turns, and the scout less the CT, on gray: bright where the scout is denser.
Image<Rgb> checkerboard(const Image<std::uint8_t>& scout, const Image<std::uint8_t>& ct, int square_px);
Image<Rgb> difference(const Image<std::uint8_t>& scout, const Image<std::uint8_t>& ct);

// Draws all tiles in two columns (wide scouts) or four (tall ones), at most this wide and high: scout and checkerboard,
// then the CT, both over one another and their difference, each as the files say and as found. Returns the height.
double draw_scout(Canvas& canvas, double x, double y, double width, double most_height, const ViewPicture& picture,
                  double aspect);

}  // namespace isoshift
