#include "phantom/xray_simulation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <span>

#include "base/error.h"
#include "base/parallel.h"

namespace isoshift {
namespace {

// 120 kVp tungsten behind 2.5 mm Al in six bins; mass attenuation coefficients of NIST (XCOM; NISTIR 5632) for water
// and for cortical bone (ICRU 44) times 1.92 g/cm3, here per mm.
struct EnergyBin {
  double share;
  double water_per_mm;
  double bone_per_mm;
};
constexpr std::array<EnergyBin, 6> kSpectrum = {{
    {0.10, 0.03756, 0.25555},  // 30 keV
    {0.20, 0.02683, 0.12778},  // 40 keV
    {0.23, 0.02269, 0.08145},  // 50 keV
    {0.22, 0.02059, 0.06044},  // 60 keV
    {0.16, 0.01837, 0.04280},  // 80 keV
    {0.09, 0.01707, 0.03562},  // 100 keV
}};

// 6 MV behind its flattening filter, likewise.
constexpr std::array<EnergyBin, 3> kMegavoltage = {{
    {0.35, 0.00707, 0.01257},  // 1 MeV
    {0.40, 0.00494, 0.00886},  // 2 MeV
    {0.25, 0.00340, 0.00640},  // 4 MeV
}};

constexpr double kFocalSpotMm = 0.6;
constexpr double kScatterSigmaMm = 60.0;  // on the panel

double cos_deg(double deg) { return std::cos(deg * std::numbers::pi / 180.0); }
double sin_deg(double deg) { return std::sin(deg * std::numbers::pi / 180.0); }

// Columns: where patient left, posterior and superior point in the room at couch angle 0. Fixed x is the right of a
// viewer facing the gantry, y toward it, z up.
Eigen::Matrix3d fixed_from_patient_axes(const std::string& position) {
  const Eigen::Vector3d toward_gantry(0, 1, 0), up(0, 0, 1);
  Eigen::Vector3d left, posterior, superior;
  if (position.starts_with("HF"))
    superior = toward_gantry;
  else if (position.starts_with("FF"))
    superior = -toward_gantry;
  else
    throw UsageError("patient position " + position + " is not one of HFS, HFP, FFS, FFP, HFDR, HFDL, FFDR, FFDL");
  const std::string lies = position.substr(2);
  if (lies == "S" || lies == "P") {  // on the back, or on the belly
    posterior = lies == "S" ? Eigen::Vector3d(-up) : up;
    left = posterior.cross(superior);
  } else if (lies == "DR" || lies == "DL") {  // on the right side, or on the left
    left = lies == "DR" ? up : Eigen::Vector3d(-up);
    posterior = superior.cross(left);
  } else {
    throw UsageError("patient position " + position + " is not one of HFS, HFP, FFS, FFP, HFDR, HFDL, FFDR, FFDL");
  }
  Eigen::Matrix3d axes;
  axes << left, posterior, superior;
  return axes;
}

// Seen from above, the couch turns x toward y.
Eigen::Matrix3d couch_turn(double angle_deg) {
  const double c = cos_deg(angle_deg), s = sin_deg(angle_deg);
  Eigen::Matrix3d turn;
  turn << c, -s, 0, s, c, 0, 0, 0, 1;
  return turn;
}

double primary_intensity(const std::vector<Shape>& shapes, std::span<const EnergyBin> spectrum,
                         const Eigen::Vector3d& source_patient_mm, const Eigen::Vector3d& pixel_patient_mm) {
  double water_mm = 0.0, bone_mm = 0.0;
  for (const Shape& shape : shapes) {
    const double chord_mm = shape.chord_mm(source_patient_mm, pixel_patient_mm);
    water_mm += chord_mm * shape.added.water;
    bone_mm += chord_mm * shape.added.bone;
  }
  double intensity = 0.0;
  for (const EnergyBin& bin : spectrum)
    intensity += bin.share * std::exp(-bin.water_per_mm * water_mm - bin.bone_per_mm * bone_mm);
  return intensity;
}

// The primary beam, blurred widely, on a grid 16 times coarser, sampled back by nearest neighbor along smooth values.
Image<float> scatter(const Image<float>& primary, double pixel_mm) {
  constexpr int kBlock = 16;
  const int edge = (primary.columns + kBlock - 1) / kBlock;
  Image<float> coarse(edge, edge);
  for (int row = 0; row < edge; ++row)
    for (int column = 0; column < edge; ++column)
      coarse.at(column, row) = primary.at(std::min(column * kBlock + kBlock / 2, primary.columns - 1),
                                          std::min(row * kBlock + kBlock / 2, primary.rows - 1));
  const double sigma = kScatterSigmaMm / (pixel_mm * kBlock);
  Image<float> blurred(edge, edge);
  for (int row = 0; row < edge; ++row)
    for (int column = 0; column < edge; ++column) {
      double sum = 0.0, weights = 0.0;
      for (int r = 0; r < edge; ++r)
        for (int c = 0; c < edge; ++c) {
          const double weight =
              std::exp(-0.5 * ((r - row) * (r - row) + (c - column) * (c - column)) / (sigma * sigma));
          sum += weight * coarse.at(c, r);
          weights += weight;
        }
      blurred.at(column, row) = static_cast<float>(sum / weights);
    }
  Image<float> result(primary.columns, primary.rows);
  for (int row = 0; row < result.rows; ++row)
    for (int column = 0; column < result.columns; ++column) {
      // Bilinear between block centers.
      const double x = std::clamp((column + 0.5) / kBlock - 0.5, 0.0, edge - 1.001);
      const double y = std::clamp((row + 0.5) / kBlock - 0.5, 0.0, edge - 1.001);
      const int i = static_cast<int>(x), j = static_cast<int>(y);
      const double fx = x - i, fy = y - j;
      result.at(column, row) =
          static_cast<float>((1 - fy) * ((1 - fx) * blurred.at(i, j) + fx * blurred.at(i + 1, j)) +
                             fy * ((1 - fx) * blurred.at(i, j + 1) + fx * blurred.at(i + 1, j + 1)));
    }
  return result;
}

}  // namespace

Eigen::Matrix3d Placement::rotation() const {
  const double cx = cos_deg(rotation_deg.x()), sx = sin_deg(rotation_deg.x());
  const double cy = cos_deg(rotation_deg.y()), sy = sin_deg(rotation_deg.y());
  Eigen::Matrix3d about_x, about_y;
  about_x << 1, 0, 0, 0, cx, -sx, 0, sx, cx;
  about_y << cy, 0, sy, 0, 1, 0, -sy, 0, cy;
  return couch_turn(rotation_deg.z()) * about_x * about_y;
}

Eigen::Vector3d Placement::patient_from_fixed(const Eigen::Vector3d& point_fixed_mm) const {
  const Eigen::Vector3d planned_mm = rotation().transpose() * (point_fixed_mm - translation_mm);
  return fixed_from_patient_axes(patient_position).transpose() *
             (couch_turn(couch_angle_deg).transpose() * planned_mm) +
         isocenter_patient_mm;
}

Eigen::Vector3d Placement::fixed_from_patient(const Eigen::Vector3d& point_patient_mm) const {
  const Eigen::Vector3d planned_mm = couch_turn(couch_angle_deg) * (fixed_from_patient_axes(patient_position) *
                                                                    (point_patient_mm - isocenter_patient_mm));
  return rotation() * planned_mm + translation_mm;
}

Eigen::Vector3d Imager::source_fixed_mm() const {
  return {sad_mm * sin_deg(gantry_angle_deg), 0.0, sad_mm * cos_deg(gantry_angle_deg)};
}

Eigen::Vector3d Imager::pixel_fixed_mm(double column, double row) const {
  const double s = sin_deg(gantry_angle_deg), c = cos_deg(gantry_angle_deg);
  const double below_mm = sid_mm - sad_mm;
  const double along_rows_mm = (column - 0.5 * (pixels - 1)) * pixel_mm;
  const double along_columns_mm = (0.5 * (pixels - 1) - row) * pixel_mm;
  const double turned_s = sin_deg(receptor_angle_deg), turned_c = cos_deg(receptor_angle_deg);
  const double right_mm = turned_c * along_rows_mm - turned_s * along_columns_mm;  // along the gantry's x axis
  const double up_mm = turned_s * along_rows_mm + turned_c * along_columns_mm;     // toward the gantry
  // Turned by the fault and shifted, in the gantry's axes; the last is depth toward the source.
  const Eigen::Vector3d& turn = fault.turn_deg;
  const Eigen::Vector3d about_y(right_mm * cos_deg(turn.y()), up_mm, -right_mm * sin_deg(turn.y()));
  const Eigen::Vector3d about_x(about_y.x(), cos_deg(turn.x()) * about_y.y() - sin_deg(turn.x()) * about_y.z(),
                                sin_deg(turn.x()) * about_y.y() + cos_deg(turn.x()) * about_y.z());
  const double x = cos_deg(turn.z()) * about_x.x() - sin_deg(turn.z()) * about_x.y() + fault.shift_mm.x();
  const double y = sin_deg(turn.z()) * about_x.x() + cos_deg(turn.z()) * about_x.y() + fault.shift_mm.y();
  const double z = about_x.z() - below_mm;
  return {c * x + s * z, y, c * z - s * x};
}

Image<float> simulate_xray(const std::vector<Shape>& shapes, const Placement& placement, const Imager& imager,
                           double photons, std::uint64_t seed) {
  // Four rays per pixel sample its area and the focal spot together.
  constexpr std::array<std::array<double, 2>, 4> kPixelOffsets = {
      {{-0.25, -0.25}, {0.25, -0.25}, {-0.25, 0.25}, {0.25, 0.25}}};
  constexpr std::array<std::array<double, 2>, 4> kSpotOffsets = {
      {{0.25, 0.25}, {-0.25, 0.25}, {0.25, -0.25}, {-0.25, -0.25}}};
  const Eigen::Vector3d spot_axis(cos_deg(imager.gantry_angle_deg), 0.0, -sin_deg(imager.gantry_angle_deg));
  std::array<Eigen::Vector3d, 4> sources_patient;
  for (int n = 0; n < 4; ++n)
    sources_patient[n] =
        placement.patient_from_fixed(imager.source_fixed_mm() + kFocalSpotMm * kSpotOffsets[n][0] * spot_axis +
                                     Eigen::Vector3d(0.0, kFocalSpotMm * kSpotOffsets[n][1], 0.0));

  Image<float> intensity(imager.pixels, imager.pixels);
  const std::span<const EnergyBin> spectrum =
      imager.is_megavoltage ? std::span<const EnergyBin>(kMegavoltage) : std::span<const EnergyBin>(kSpectrum);
  parallel_for(0, imager.pixels, [&](int row) {
    for (int column = 0; column < imager.pixels; ++column) {
      double sum = 0.0;
      for (int n = 0; n < 4; ++n)
        sum += primary_intensity(shapes, spectrum, sources_patient[n],
                                 placement.patient_from_fixed(
                                     imager.pixel_fixed_mm(column + kPixelOffsets[n][0], row + kPixelOffsets[n][1])));
      intensity.at(column, row) = static_cast<float>(0.25 * sum);
    }
  });

  const Image<float> scattered = scatter(intensity, imager.pixel_mm);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> gauss;
  for (std::size_t n = 0; n < intensity.pixels.size(); ++n) {
    const double expected =
        (intensity.pixels[n] + imager.scatter_share * scattered.pixels[n]) / (1.0 + imager.scatter_share);
    const double noise = photons > 0.0 ? std::sqrt(expected / photons) * gauss(random) : 0.0;
    intensity.pixels[n] = static_cast<float>(std::max(0.0, expected + noise));
  }
  return intensity;
}

}  // namespace isoshift
