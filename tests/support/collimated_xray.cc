#include "tests/support/collimated_xray.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>

#include "geometry/rotation.h"

namespace isoshift {
namespace {

constexpr double kPanelMm = 400.0, kMagnification = 1.5;
constexpr double kHalfMm = 0.5 * kPanelMm / kMagnification;  // of the panel, at the isocenter

using Random = std::mt19937_64;

double between(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

// Attenuation along parallel rays through an ellipsoid, `depth_mm` thick at its middle.
struct Ellipsoid {
  Eigen::Vector2d center_mm, radius_mm;
  double turn_rad, depth_mm, per_mm;

  double at(const Eigen::Vector2d& point_mm) const {
    const Eigen::Vector2d q = Eigen::Rotation2Dd(-turn_rad) * (point_mm - center_mm);
    const double inside = 1.0 - q.cwiseQuotient(radius_mm).squaredNorm();
    return inside > 0.0 ? per_mm * depth_mm * std::sqrt(inside) : 0.0;
  }
};

// A rod of metal, and the couch: a band with a round profile.
struct Band {
  Eigen::Vector2d middle_mm;
  double turn_rad, half_length_mm, half_width_mm, attenuation;

  double at(const Eigen::Vector2d& point_mm) const {
    const Eigen::Vector2d q = Eigen::Rotation2Dd(-turn_rad) * (point_mm - middle_mm);
    if (std::abs(q.x()) > half_length_mm || std::abs(q.y()) > half_width_mm) return 0.0;
    return attenuation * std::sqrt(1.0 - std::pow(q.y() / half_width_mm, 2));
  }
};

constexpr double kTissue = 0.019, kBone = 0.035, kLung = -0.014;  // per mm; bone and lung relative to tissue

void add_skull(Random& random, std::vector<Ellipsoid>& body) {
  const Eigen::Vector2d center(between(random, -15, 15), between(random, -15, 15));
  const Eigen::Vector2d outer(between(random, 70, 80), between(random, 85, 100));
  const double turn = between(random, -0.3, 0.3);
  body.push_back({center, outer, turn, 150.0, kTissue});
  body.push_back({center, outer * 0.95, turn, 142.0, kBone});
  body.push_back({center, outer * 0.88, turn, 132.0, -kBone});
  for (int n = 0; n < 6; ++n)  // the base, the jaw and the sinuses
    body.push_back({center + Eigen::Vector2d(between(random, -45, 45), between(random, -80, -20)),
                    {between(random, 6, 25), between(random, 4, 15)},
                    between(random, 0, 3.1),
                    between(random, 15, 40),
                    n % 3 == 0 ? -kTissue : kBone});
}

void add_thorax(Random& random, std::vector<Ellipsoid>& body) {
  const double turn = between(random, -0.1, 0.1);
  const Eigen::Vector2d center(between(random, -40, 40), between(random, -30, 30));
  body.push_back({center, {between(random, 100, 170), 320}, turn, between(random, 200, 320), kTissue});
  for (const double side : {-1.0, 1.0})
    body.push_back({center + Eigen::Vector2d(side * between(random, 50, 65), between(random, -20, 40)),
                    {between(random, 35, 48), between(random, 90, 120)},
                    between(random, -0.15, 0.15),
                    between(random, 110, 170),
                    kLung});
  for (int level = -6; level <= 6; ++level) {
    body.push_back({center + Eigen::Vector2d(0, 24.0 * level), {17, 9.5}, turn, 30.0, kBone});
    body.push_back({center + Eigen::Vector2d(0, 24.0 * level + 10.0), {100, 3.5}, turn + 0.2, 9.0, kBone});
  }
}

void add_limb(Random& random, std::vector<Ellipsoid>& body) {
  const double turn = between(random, 0, 3.1);
  const Eigen::Vector2d center(between(random, -30, 30), between(random, -30, 30));
  body.push_back({center, {260, between(random, 30, 55)}, turn, 90.0, kTissue});
  body.push_back({center, {300, 14}, turn, 26.0, kBone});
}

// What attenuates, as lists.
struct Contents {
  std::vector<Ellipsoid> body;
  std::vector<Band> bands;

  double at(const Eigen::Vector2d& point_mm) const {
    double sum = 0.0;
    for (const Ellipsoid& part : body) sum += part.at(point_mm);
    sum = std::max(sum, 0.0);
    for (const Band& band : bands) sum += band.at(point_mm);
    return sum;
  }
};

Contents contents_of(const CollimatedXray& scene) {
  Random random(scene.seed);
  Contents contents;
  switch (scene.body) {
    case CollimatedXray::Body::kSkull: add_skull(random, contents.body); break;
    case CollimatedXray::Body::kThorax: add_thorax(random, contents.body); break;
    case CollimatedXray::Body::kLimb: add_limb(random, contents.body); break;
    case CollimatedXray::Body::kBall: contents.body.push_back({{0.5, -0.7}, {3, 3}, 0, 6.0, 0.4}); break;
    case CollimatedXray::Body::kNone: break;
  }
  for (int n = 0; n < scene.metal_rods; ++n)
    contents.bands.push_back({{between(random, -90, 90), between(random, -90, 90)},
                              between(random, 0, 3.1),
                              between(random, 20, 90),
                              between(random, 1.5, 5),
                              between(random, 1.5, 4)});
  if (scene.has_couch)
    contents.bands.push_back({{between(random, 85, 105), 0},
                              0.5 * std::numbers::pi,
                              1e4,
                              between(random, 6, 15),
                              between(random, 0.2, 0.7)});
  return contents;
}

// The share of the beam that passes a straight edge `inside_mm` away.
double passing(double inside_mm, double penumbra_mm) {
  return 0.5 * std::erfc(-inside_mm / (penumbra_mm / 1.683 * std::numbers::sqrt2));
}

// The share of the beam that passes an opening: a circle or a rectangle.
double share_within(const Eigen::Vector2d& lower_mm, const Eigen::Vector2d& upper_mm, bool is_circle,
                    const Eigen::Vector2d& q, double penumbra_mm) {
  if (is_circle) {
    const double radius_mm = 0.5 * (upper_mm - lower_mm).minCoeff();
    return passing(radius_mm - (q - 0.5 * (lower_mm + upper_mm)).norm(), penumbra_mm);
  }
  double share = 1.0;
  for (int axis = 0; axis < 2; ++axis)
    share *= passing(q[axis] - lower_mm[axis], penumbra_mm) * passing(upper_mm[axis] - q[axis], penumbra_mm);
  return share;
}

// What passes leaves or a cone, and the jaws behind.
double open_share(const CollimatedXray& scene, const Eigen::Vector2d& point_mm) {
  constexpr double kHaloMm = 3.5 * 1.683, kJawPenumbraMm = 2.5;  // from 20 % to 80 %
  const Eigen::Vector2d q = Eigen::Rotation2Dd(-rad_from_deg(scene.collimator_deg)) * point_mm;
  double share = share_within(scene.lower_mm, scene.upper_mm, scene.is_cone, q, scene.penumbra_mm);
  if (scene.halo_share > 0.0)
    share += scene.halo_share * (share_within(scene.lower_mm, scene.upper_mm, scene.is_cone, q, kHaloMm) - share);
  return (scene.leakage + (1.0 - scene.leakage) * share) *
         share_within(scene.jaw_lower_mm, scene.jaw_upper_mm, false, q, kJawPenumbraMm);
}

// Blurred by Gaussians of 30 and 80 mm, in blocks: scatter has no detail.
cv::Mat scatter_of(const cv::Mat& primary, double pixel_mm) {
  constexpr int kBlock = 8;
  cv::Mat blocks, narrow, wide, result;
  cv::resize(primary, blocks, {}, 1.0 / kBlock, 1.0 / kBlock, cv::INTER_AREA);
  cv::GaussianBlur(blocks, narrow, {}, 30.0 / pixel_mm / kBlock, 0, cv::BORDER_REPLICATE);
  cv::GaussianBlur(blocks, wide, {}, 80.0 / pixel_mm / kBlock, 0, cv::BORDER_REPLICATE);
  cv::resize(0.6 * narrow + 0.4 * wide, result, primary.size(), 0, 0, cv::INTER_CUBIC);
  return result;
}

}  // namespace

XrayImage xray_of(const CollimatedXray& scene) {
  const Contents contents = contents_of(scene);
  const int pixels = scene.pixels;
  const double pixel_mm = 2.0 * kHalfMm / pixels;
  cv::Mat primary(pixels, pixels, CV_32F);
  for (int row = 0; row < pixels; ++row)
    for (int column = 0; column < pixels; ++column) {
      const Eigen::Vector2d point_mm((column + 0.5) * pixel_mm - kHalfMm, kHalfMm - (row + 0.5) * pixel_mm);
      primary.at<float>(row, column) =
          static_cast<float>(open_share(scene, point_mm) * std::exp(-contents.at(point_mm)));
    }
  const cv::Mat scattered = scene.scatter * scatter_of(primary, pixel_mm);

  CarmGeometry geometry;
  geometry.sad_mm = 1000.0;
  geometry.receptor_translation_mm = Eigen::Vector3d(0, 0, -500);
  geometry.column_spacing_mm = geometry.row_spacing_mm = kPanelMm / pixels;
  geometry.position_mm = 0.5 * (pixels - 1) * kPanelMm / pixels * Eigen::Vector2d(-1, 1);
  geometry.columns = geometry.rows = pixels;
  XrayImage xray;
  xray.label = "X";
  xray.view = make_xray_view(geometry, scene.beam);
  xray.collimator_angle_rad = rad_from_deg(scene.collimator_deg);
  xray.values = Image<float>(pixels, pixels);
  Random random(scene.seed + 77);
  std::normal_distribution<double> normal;
  const double slope_x = between(random, -1, 1) * scene.gain_slope, slope_y = between(random, -1, 1) * scene.gain_slope;
  for (int row = 0; row < pixels; ++row)
    for (int column = 0; column < pixels; ++column) {
      const double arrives = primary.at<float>(row, column) + scattered.at<float>(row, column);
      const double noise = std::sqrt(arrives / scene.photons + 1e-8) * normal(random);
      const double gain = 1.0 + slope_x * (2.0 * column / pixels - 1.0) + slope_y * (2.0 * row / pixels - 1.0);
      xray.values.at(column, row) = static_cast<float>(std::round(std::max(0.0, 40000.0 * gain * (arrives + noise))));
    }
  return xray;
}

CollimatedXray random_collimated_xray(std::uint64_t seed) {
  Random random(seed);
  CollimatedXray scene;
  scene.seed = seed;
  scene.body =
      std::array{CollimatedXray::Body::kSkull, CollimatedXray::Body::kThorax, CollimatedXray::Body::kLimb}[seed % 3];
  scene.metal_rods = static_cast<int>(random() % 4);
  scene.has_couch = random() % 3 == 0;
  scene.penumbra_mm = between(random, 1, 3);
  scene.leakage = between(random, 0, 0.02);
  scene.scatter = between(random, 0, 0.2);
  scene.photons = std::exp(between(random, std::log(3000.0), std::log(60000.0)));
  scene.gain_slope = between(random, 0, 0.1);
  if (random() % 4 == 0) scene.collimator_deg = between(random, -45, 45);
  const bool is_turned = scene.collimator_deg != 0.0;
  const bool reaches_rim = !is_turned && random() % 4 == 0;
  constexpr double kRoomMm = kHalfMm - 6.0;
  for (int axis = 0; axis < 2; ++axis) {
    const double width = between(random, 40, 200);
    // A turned field keeps its corners on the panel.
    const double reach = is_turned ? 0.7 * kRoomMm : kRoomMm;
    const double limited = std::min(width, 1.9 * reach);
    const double middle = between(random, -1, 1) * (reach - 0.5 * limited) * 0.8;
    scene.lower_mm[axis] = middle - 0.5 * limited;
    scene.upper_mm[axis] = middle + 0.5 * limited;
  }
  if (reaches_rim)
    for (int axis = 0; axis < 2; ++axis) {
      if (random() % 2 == 0) scene.lower_mm[axis] = -kHalfMm - 20.0;
      if (random() % 3 == 0) scene.upper_mm[axis] = kHalfMm + 20.0;
    }
  return scene;
}

CollimatedXray opened(CollimatedXray scene) {
  scene.lower_mm.setConstant(-1000.0);
  scene.upper_mm.setConstant(1000.0);
  return scene;
}

double field_error_mm(const CollimatedXray& scene, const XrayView& view,
                      const std::vector<Eigen::Vector2d>& corners_px) {
  const double pixels_per_mm = scene.pixels / (2.0 * kHalfMm);
  const Eigen::Vector2d middle_px(0.5 * (view.columns - 1), 0.5 * (view.rows - 1));
  // The corners along the collimator's axes, at the isocenter.
  std::vector<Eigen::Vector2d> corners_mm;
  for (const Eigen::Vector2d& corner : corners_px) {
    const Eigen::Vector2d displayed((corner - middle_px).cwiseProduct(Eigen::Vector2d(1, -1)) / pixels_per_mm);
    corners_mm.emplace_back(Eigen::Rotation2Dd(-rad_from_deg(scene.collimator_deg)) * displayed);
  }
  const double rim = scene.collimator_deg == 0.0 ? kHalfMm : 1000.0;
  double error = corners_px.empty() ? 1e3 : 0.0;
  for (const Eigen::Vector2d& corner : corners_mm)
    for (int axis = 0; axis < 2; ++axis) {
      const double lower = std::max(scene.lower_mm[axis], -rim), upper = std::min(scene.upper_mm[axis], rim);
      const double off = std::min(std::abs(corner[axis] - lower), std::abs(corner[axis] - upper));
      error = std::max(error, off);
    }
  // All corners on one side would be near that side, too.
  for (int axis = 0; axis < 2; ++axis) {
    double low = 1e9, high = -1e9;
    for (const Eigen::Vector2d& corner : corners_mm) {
      low = std::min(low, corner[axis]);
      high = std::max(high, corner[axis]);
    }
    error = std::max({error, std::abs(low - std::max(scene.lower_mm[axis], -rim)),
                      std::abs(high - std::min(scene.upper_mm[axis], rim))});
  }
  return error;
}

}  // namespace isoshift
