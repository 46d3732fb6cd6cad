#pragma once
// X-rays of a deformed patient by marching rays through the CT. Everything is written down in IEC 61217 fixed
// coordinates (x to the right seen facing the gantry, y toward the gantry, z up), with no camera and no renderer of
// isoshift.

#include <Eigen/Core>
#include <random>
#include <span>
#include <vector>

#include "tests/real_data/campaign/deformation.h"
#include "tests/real_data/campaign/patient.h"

namespace isoshift::campaign {

// Where the patient lies: planned x (room, mm from the isocenter) is found at R x + t.
struct Setup {
  Eigen::Vector3d isocenter_patient_mm = Eigen::Vector3d::Zero();
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();
};

// Columns: where the patient's left, back and head point in the room. HFS or FFS, couch at 0.
Eigen::Matrix3d room_axes(const std::string& patient_position);

struct Exposure {
  double gantry_deg = 0.0;
  bool is_megavoltage = false;
  double photons = 2e5;         // per open pixel
  double scatter_share = 0.15;  // of the primary beam
  double blur_mm = 0.35;        // of the receptor and the focal spot, one standard deviation on the panel
  // The irradiated field in the plane of the isocenter, mm: left, right, low, high edges along the panel's axes.
  bool is_collimated = false;
  double left_mm = 0.0, right_mm = 0.0, low_mm = 0.0, high_mm = 0.0;
  double leakage = 0.0;  // share of the open beam that passes the jaws
};

inline constexpr double kSadMm = 1000.0, kSidMm = 1500.0;
inline constexpr int kPixels = 640;
inline constexpr double kPixelMm = 0.64;  // on the panel

// Intensity per pixel of every exposure, row-major, 1 in the open beam. Column 0 at the left and row 0 at the top, seen
// from the source with the gantry at the top.
std::vector<std::vector<float>> expose(const Patient& patient, const Deformation& deformation, const Setup& setup,
                                       std::span<const Exposure> exposures, std::mt19937_64& random);

}  // namespace isoshift::campaign
