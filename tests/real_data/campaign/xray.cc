#include "tests/real_data/campaign/xray.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <span>

namespace isoshift::campaign {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::Vector3f;

// Attenuation of water and of cortical bone (1.92 g/cm3), and the detected share: about 40, 60, 80 and 100 keV behind a
// filter of 120 kV, and 2 MeV. Mass attenuation coefficients of NIST (Hubbell and Seltzer, NISTIR 5632).
struct Energy {
  double water_per_mm, bone_per_mm, share;
};
constexpr std::array<Energy, 4> kKilovoltage = {
    {{0.02683, 0.1278, 0.15}, {0.02059, 0.0604, 0.35}, {0.01837, 0.0428, 0.30}, {0.01707, 0.0356, 0.20}}};
constexpr std::array<Energy, 1> kMegavoltage = {{{0.00494, 0.00877, 1.0}}};
constexpr double kBoneToWaterInCt = 2.59;  // of their attenuation, as a CT scanner of 120 kV sees it

constexpr double kStepMm = 1.0;  // along a ray

// Millimeters of water and bone along a ray.
struct Path {
  double water_mm = 0.0, bone_mm = 0.0;
};

// Above 100 HU a voxel holds cortical bone, more of it the brighter it is.
void add(Path& path, float hu, float step_mm) {
  const float bone = std::max(0.0F, hu - 100.0F) / 2000.0F;
  path.bone_mm += bone * step_mm;
  path.water_mm += (1.0F + hu / 1000.0F - static_cast<float>(kBoneToWaterInCt) * bone) * step_mm;
}

class RayMarcher {
 public:
  RayMarcher(const Patient& patient, const Deformation& deformation)
      : patient_(patient), first_mm_(patient.first_mm.cast<float>()) {
    per_mm_ = patient.spacing_mm.cwiseInverse().cast<float>();
    const Vector3d margin = Vector3d::Constant(deformation.is_identity() ? 0.0 : 40.0);
    low_mm_ = patient.first_mm - margin;
    high_mm_ = patient.place_mm(patient.size.x() - 1, patient.size.y() - 1, patient.size.z() - 1) + margin;
    if (!deformation.is_identity()) field_.emplace(deformation, low_mm_, high_mm_);
  }

  Path along(const Vector3d& begin_mm, const Vector3d& end_mm) const {
    double first = 0.0, last = 1.0;
    const Vector3d way = end_mm - begin_mm;
    for (int axis = 0; axis < 3; ++axis) {
      const double a = (low_mm_[axis] - begin_mm[axis]) / way[axis], b = (high_mm_[axis] - begin_mm[axis]) / way[axis];
      first = std::max(first, std::min(a, b));
      last = std::min(last, std::max(a, b));
    }
    Path path;
    const double length_mm = (last - first) * way.norm();
    const int steps = static_cast<int>(std::ceil(length_mm / kStepMm));
    if (steps <= 0) return path;
    const auto step_mm = static_cast<float>(length_mm / steps);
    const Vector3f step = (way.normalized() * static_cast<double>(step_mm)).cast<float>();
    const Vector3f start = (begin_mm + way * first).cast<float>() + 0.5F * step;
    if (!field_) {
      for (int n = 0; n < steps; ++n) add(path, hu_at(start + static_cast<float>(n) * step), step_mm);
      return path;
    }
    // Displacements change slowly: one for every four steps, linear between them.
    constexpr int kBetween = 4;
    Vector3f here = start + field_->at(start);
    for (int n = 0; n < steps; n += kBetween) {
      const Vector3f there_mm = start + static_cast<float>(n + kBetween) * step;
      const Vector3f there = there_mm + field_->at(there_mm), piece = (there - here) / static_cast<float>(kBetween);
      for (int m = 0; m < std::min(kBetween, steps - n); ++m)
        add(path, hu_at(here + static_cast<float>(m) * piece), step_mm);
      here = there;
    }
    return path;
  }

 private:
  float hu_at(const Vector3f& planned_mm) const {
    const Vector3f place = (planned_mm - first_mm_).cwiseProduct(per_mm_);
    if (!(place.x() >= 0.0F && place.y() >= 0.0F && place.z() >= 0.0F)) return -1000.0F;
    const int i = static_cast<int>(place.x()), j = static_cast<int>(place.y()), k = static_cast<int>(place.z());
    if (i + 1 >= patient_.size.x() || j + 1 >= patient_.size.y() || k + 1 >= patient_.size.z()) return -1000.0F;
    const float x = place.x() - static_cast<float>(i), y = place.y() - static_cast<float>(j),
                z = place.z() - static_cast<float>(k);
    const std::int16_t* v = &patient_.hu[(static_cast<std::size_t>(k) * patient_.size.y() + j) * patient_.size.x() + i];
    const auto row = static_cast<std::ptrdiff_t>(patient_.size.x()), slice = row * patient_.size.y();
    const auto line = [x](const std::int16_t* at) {
      return static_cast<float>(at[0]) + x * static_cast<float>(at[1] - at[0]);
    };
    const float near = line(v) + y * (line(v + row) - line(v));
    const float far = line(v + slice) + y * (line(v + slice + row) - line(v + slice));
    return near + z * (far - near);
  }

  const Patient& patient_;
  Vector3f first_mm_, per_mm_;
  Vector3d low_mm_, high_mm_;
  std::optional<DisplacementField> field_;
};

// A separable Gauss filter with edges continued.
void blur(std::vector<float>& image, int edge, double sigma_px) {
  if (sigma_px < 0.1) return;
  const int reach = std::min(edge - 1, static_cast<int>(std::ceil(3.0 * sigma_px)));
  std::vector<float> weights;
  float sum = 0.0F;
  for (int n = -reach; n <= reach; ++n) {
    weights.push_back(static_cast<float>(std::exp(-0.5 * n * n / (sigma_px * sigma_px))));
    sum += weights.back();
  }
  std::vector<float> line(static_cast<std::size_t>(edge));
  for (const bool along_rows : {true, false})
    for (int a = 0; a < edge; ++a) {
      const auto pixel = [&](int b) -> float& {
        return image[static_cast<std::size_t>(along_rows ? a * edge + b : b * edge + a)];
      };
      for (int b = 0; b < edge; ++b) line[static_cast<std::size_t>(b)] = pixel(b);
      for (int b = 0; b < edge; ++b) {
        float value = 0.0F;
        for (int n = -reach; n <= reach; ++n)
          value += weights[static_cast<std::size_t>(n + reach)] *
                   line[static_cast<std::size_t>(std::clamp(b + n, 0, edge - 1))];
        pixel(b) = value / sum;
      }
    }
}

// Scatter: the beam behind the patient, blurred by 40 mm, computed on blocks of 16 pixels.
std::vector<float> scattered(const std::vector<float>& primary) {
  constexpr int kBlock = 16, kEdge = kPixels / kBlock;
  std::vector<float> coarse(kEdge * kEdge, 0.0F);
  for (int row = 0; row < kPixels; ++row)
    for (int column = 0; column < kPixels; ++column)
      coarse[static_cast<std::size_t>(row / kBlock * kEdge + column / kBlock)] +=
          primary[static_cast<std::size_t>(row * kPixels + column)] / (kBlock * kBlock);
  blur(coarse, kEdge, 40.0 / (kPixelMm * kBlock));
  std::vector<float> fine(primary.size());
  for (int row = 0; row < kPixels; ++row)
    for (int column = 0; column < kPixels; ++column) {
      const double y = std::clamp((row + 0.5) / kBlock - 0.5, 0.0, kEdge - 1.001);
      const double x = std::clamp((column + 0.5) / kBlock - 0.5, 0.0, kEdge - 1.001);
      const int j = static_cast<int>(y), i = static_cast<int>(x);
      const auto at = [&](int dj, int di) { return coarse[static_cast<std::size_t>((j + dj) * kEdge + i + di)]; };
      const double top = at(0, 0) + (x - i) * (at(0, 1) - at(0, 0)), low = at(1, 0) + (x - i) * (at(1, 1) - at(1, 0));
      fine[static_cast<std::size_t>(row * kPixels + column)] = static_cast<float>(top + (y - j) * (low - top));
    }
  return fine;
}

// Share of the open beam that the jaws let pass: edges with a penumbra of 1.5 mm in the plane of the isocenter.
double opened(const Exposure& exposure, double right_mm, double up_mm) {
  if (!exposure.is_collimated) return 1.0;
  const auto edge = [](double inside_mm) { return 0.5 * std::erfc(-inside_mm / (1.5 * std::numbers::sqrt2)); };
  const double open = edge(right_mm - exposure.left_mm) * edge(exposure.right_mm - right_mm) *
                      edge(up_mm - exposure.low_mm) * edge(exposure.high_mm - up_mm);
  return exposure.leakage + (1.0 - exposure.leakage) * open;
}

double transmitted(const Path& path, bool is_megavoltage) {
  const std::span<const Energy> energies =
      is_megavoltage ? std::span<const Energy>(kMegavoltage) : std::span<const Energy>(kKilovoltage);
  double sum = 0.0;
  for (const Energy& energy : energies)
    sum += energy.share * std::exp(-energy.water_per_mm * path.water_mm - energy.bone_per_mm * path.bone_mm);
  return sum;
}

std::vector<float> expose_one(const RayMarcher& rays, const Matrix3d& axes, const Setup& setup,
                              const Exposure& exposure, std::mt19937_64& random) {
  const double gantry_rad = exposure.gantry_deg * std::numbers::pi / 180.0;
  const double s = std::sin(gantry_rad), c = std::cos(gantry_rad);
  const Vector3d source(kSadMm * s, 0.0, kSadMm * c), right(c, 0.0, -s), up(0.0, 1.0, 0.0);
  const Vector3d panel = -(kSidMm - kSadMm) * source / kSadMm;
  const Matrix3d patient_from_room = axes.transpose() * setup.rotation.transpose();
  const auto in_patient = [&](const Vector3d& room_mm) {
    return Vector3d(patient_from_room * (room_mm - setup.translation_mm) + setup.isocenter_patient_mm);
  };
  std::vector<float> image(static_cast<std::size_t>(kPixels) * kPixels);
  for (int row = 0; row < kPixels; ++row)
    for (int column = 0; column < kPixels; ++column) {
      const double right_mm = (column - 0.5 * (kPixels - 1)) * kPixelMm, up_mm = (0.5 * (kPixels - 1) - row) * kPixelMm;
      const double open = opened(exposure, right_mm * kSadMm / kSidMm, up_mm * kSadMm / kSidMm);
      const Path path = rays.along(in_patient(source), in_patient(panel + right_mm * right + up_mm * up));
      image[static_cast<std::size_t>(row * kPixels + column)] =
          static_cast<float>(open * transmitted(path, exposure.is_megavoltage));
    }
  blur(image, kPixels, exposure.blur_mm / kPixelMm);
  const std::vector<float> scatter = scattered(image);
  std::normal_distribution<double> gauss;
  for (std::size_t n = 0; n < image.size(); ++n) {
    const double expected = (image[n] + exposure.scatter_share * scatter[n]) / (1.0 + exposure.scatter_share);
    image[n] = static_cast<float>(std::max(0.0, expected + std::sqrt(expected / exposure.photons) * gauss(random)));
  }
  return image;
}

}  // namespace

Matrix3d room_axes(const std::string& patient_position) {
  Matrix3d axes;
  // On the back: the back points down. Head first the left is at the right of who faces the gantry.
  if (patient_position == "HFS")
    axes << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  else
    axes << -1, 0, 0, 0, 0, -1, 0, -1, 0;
  return axes;
}

std::vector<std::vector<float>> expose(const Patient& patient, const Deformation& deformation, const Setup& setup,
                                       std::span<const Exposure> exposures, std::mt19937_64& random) {
  const RayMarcher rays(patient, deformation);
  std::vector<std::vector<float>> images;
  for (const Exposure& exposure : exposures)
    images.push_back(expose_one(rays, room_axes(patient.position), setup, exposure, random));
  return images;
}

}  // namespace isoshift::campaign
