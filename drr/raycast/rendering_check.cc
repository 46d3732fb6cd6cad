#include "drr/raycast/rendering_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include "drr/images_on_gpu.h"
#include "geometry/rotation.h"

namespace isoshift {
namespace {

// Differences that correct devices stay below, and none that samples elsewhere, with other weights or another
// attenuation does (docs/renderers.md, "Before a GPU is trusted"). Steps of a voxel miss a part of sharp edges.
constexpr double kMostOfEdges = 0.02, kMostOfWaves = 0.002, kMostOfSlopes = 0.15;

// HU(i, j, k) in voxels of 3 x 2.5 x 3.5 mm, with oblique axes about the isocenter.
template <class Hu>
Volume<float> small_ct(const Eigen::Vector3i& size, Hu&& hu) {
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
  patient_from_voxel.linear() =
      rotation_z(rad_from_deg(7)) * rotation_x(rad_from_deg(-5)) * Eigen::Vector3d(3.0, 2.5, 3.5).asDiagonal();
  patient_from_voxel.translation() = -patient_from_voxel.linear() * (0.5 * (size.array() - 1).cast<double>()).matrix();
  Volume<float> ct(size, patient_from_voxel, -1000.0F);
  for (int k = 0; k < size.z(); ++k)
    for (int j = 0; j < size.y(); ++j)
      for (int i = 0; i < size.x(); ++i) ct.at(i, j, k) = static_cast<float>(hu(Eigen::Vector3i(i, j, k)));
  return ct;
}

// Water in air.
Volume<float> water_cube() {
  return small_ct({22, 24, 20}, [](const Eigen::Vector3i& at) {
    return (at.array() >= 5).all() && (at.array() < 16).all() ? 0.0 : -1000.0;
  });
}

// Waves of 9 to 13 voxels, different along each axis, without a plane of symmetry; they fade to air at the faces.
constexpr AttenuationModel kAllAttenuates{.threshold_hu = -1001.0};  // a threshold would make edges

Volume<float> waves() {
  const Eigen::Vector3i size(28, 25, 31);
  return small_ct(size, [&](const Eigen::Vector3i& at) {
    const auto wave = [](double place, double length, double phase) {
      return std::sin(2.0 * std::numbers::pi * place / length + phase);
    };
    double fading = 1.0;
    for (int axis = 0; axis < 3; ++axis) fading *= std::sin(std::numbers::pi * (at[axis] + 1.0) / (size[axis] + 1.0));
    return -1000.0 + fading * (1300.0 + 250.0 * wave(at.x(), 9.0, 0.3) + 200.0 * wave(at.y(), 11.0, 1.1) +
                               150.0 * wave(at.z(), 13.0, 2.0) + 4.0 * at.x() - 3.0 * at.y() + 5.0 * at.z());
  });
}

XrayView view_from(double gantry_deg, Beam beam) {
  CarmGeometry geometry;
  geometry.sad_mm = 1000.0;
  geometry.gantry_angle_rad = rad_from_deg(gantry_deg);
  geometry.receptor_translation_mm = Eigen::Vector3d(0, 0, -500);
  geometry.column_spacing_mm = 6.5;
  geometry.row_spacing_mm = 5.5;
  geometry.columns = 24;
  geometry.rows = 20;
  geometry.position_mm = {-0.5 * 23 * geometry.column_spacing_mm, 0.5 * 19 * geometry.row_spacing_mm};
  return make_xray_view(geometry, beam);
}

std::vector<Eigen::Isometry3d> poses() {
  Eigen::Isometry3d turned = Eigen::Isometry3d::Identity();
  turned.linear() = rotation_y(rad_from_deg(20)) * rotation_x(rad_from_deg(-35));
  turned.translation() = Eigen::Vector3d(4, -3, 6);
  return {Eigen::Isometry3d::Identity(), turned};
}

class Check {
 public:
  void run(const MakeRayCaster& make, const char* what, const Volume<float>& ct, const AttenuationModel& model,
           double most, std::optional<double> most_of_slopes = {}) {
    const std::vector<XrayView> views = {view_from(35.0, kBeams[0]), view_from(100.0, kBeams[1])};
    const std::vector<Eigen::Isometry3d> at = poses();
    const std::unique_ptr<Renderer> tested = make(ct, model, kBeams);
    const auto oracle = make_renderer(RendererKind::kTrilinear, ct, model, kBeams);
    const PixelSet some = PixelSet::random(views, 0.05, 1);
    largest_of_volume_ = 0.0;
    for (const PixelSet& pixels : {PixelSet::all(), some}) {
      poison(*tested, views, at.size(), pixels);
      const RenderResult drrs = tested->render(views, at, pixels), known = oracle->render(views, at, pixels);
      for (std::size_t pose = 0; pose < at.size(); ++pose)
        for (std::size_t view = 0; view < views.size(); ++view)
          compare(what, drrs.line_integrals(pose, view), known.line_integrals(pose, view), most);
      poison(*tested, views, 1, pixels);
      const RenderResult single = tested->render(views, std::span(at).subspan(1, 1), pixels);
      for (std::size_t view = 0; view < views.size(); ++view)
        if (!std::ranges::equal(single.line_integrals(0, view), drrs.line_integrals(1, view)))
          fail(what, "an image depends on what is rendered beside it");
    }
    if (!most_of_slopes || !tested->has_derivatives()) return;
    const PixelSet more = PixelSet::random(views, 0.2, 2);
    poison(*tested, views, at.size(), more);
    const RenderResult found = tested->render_with_derivatives(views, at, more),
                       known = oracle->render_with_derivatives(views, at, more);
    for (std::size_t pose = 0; pose < at.size(); ++pose)
      for (std::size_t view = 0; view < views.size(); ++view) {
        compare(what, found.line_integrals(pose, view), known.line_integrals(pose, view), most);
        compare_derivatives(what, found.derivatives(pose, view), known.derivatives(pose, view), *most_of_slopes);
      }
  }

  // Ever more rays through a volume in which no sample is passed over, until it takes a while.
  void time(const MakeRayCaster& make, const Volume<float>& ct) {
    constexpr std::chrono::milliseconds kAWhile(2);
    constexpr std::size_t kMostPoses = 1024;
    const std::unique_ptr<Renderer> tested = make(ct, kAllAttenuates, kBeams);
    const XrayView view = view_from(35.0, kBeams[0]);
    std::chrono::duration<double> time(0);
    for (std::size_t count = 8; time < kAWhile && count <= kMostPoses; count *= 2) {
      const std::vector<Eigen::Isometry3d> many(count, poses()[1]);
      const auto begin = std::chrono::steady_clock::now();
      tested->render(std::span(&view, 1), many, PixelSet::all());
      time = std::chrono::steady_clock::now() - begin;
      const auto rays = static_cast<double>(count) * view.columns * view.rows;
      result_.samples_per_second = rays * ct.size.maxCoeff() / std::max(1e-9, time.count());
    }
  }

  const RenderingCheck& result() const { return result_; }
  double largest_of_volume() const { return largest_of_volume_; }  // of the last run(), as RenderingCheck::largest

 private:
  static void poison(Renderer& renderer, std::span<const XrayView> views, std::size_t poses, const PixelSet& pixels) {
    std::size_t count = 0;
    for (std::size_t view = 0; view < views.size(); ++view) count += poses * pixels.count(views, view);
    if (ImagesOnGpu* gpu = renderer.on_gpu()) gpu->poison(count);
  }

  void compare(const char* what, std::span<const float> drr, std::span<const float> known, double most) {
    if (!std::ranges::all_of(drr, [](float value) { return std::isfinite(value); }))
      return fail(what, "not every pixel was rendered");
    double squares = 0.0, largest = 0.0;
    for (std::size_t n = 0; n < drr.size(); ++n) {
      const double difference = std::abs(static_cast<double>(drr[n]) - known[n]);
      squares += difference * difference;
      largest = std::max(largest, difference);
    }
    const double scale = std::ranges::max(known), rms = std::sqrt(squares / static_cast<double>(drr.size())) / scale;
    result_.rms = std::max(result_.rms, rms);
    result_.largest = std::max(result_.largest, largest / scale);
    largest_of_volume_ = std::max(largest_of_volume_, largest / scale);
    if (!(largest <= most * scale))
      fail(what, fmt::format("its line integrals differ from the reference by {:.2g} of the largest (rms {:.2g}), "
                             "expected at most {}",
                             largest / scale, rms, most));
  }

  void compare_derivatives(const char* what, std::span<const MotionDerivatives> found,
                           std::span<const MotionDerivatives> known, double most) {
    for (int axis = 0; axis < 6; ++axis) {
      double wrong = 0.0, all = 0.0;
      for (std::size_t n = 0; n < found.size(); ++n) {
        wrong += std::pow(static_cast<double>(found[n][axis]) - known[n][axis], 2);
        all += std::pow(static_cast<double>(known[n][axis]), 2);
      }
      const double share = std::sqrt(wrong / all);
      result_.slopes = std::max(result_.slopes, share);
      if (!(share <= most))
        fail(what, fmt::format("derivatives of its line integrals differ from the reference by {:.2g} (rms, relative), "
                               "expected at most {}",
                               share, most));
    }
  }

  void fail(const char* what, std::string_view why) {
    if (!result_.failure) result_.failure = fmt::format("{}: {}", what, why);
  }

  RenderingCheck result_;
  double largest_of_volume_ = 0.0;
};

}  // namespace

RenderingCheck check_rendering(const MakeRayCaster& make) {
  Check check;
  const Volume<float> full = waves();
  check.run(make, "a cube of water", water_cube(), {}, kMostOfEdges);
  check.run(make, "a volume of waves", full, kAllAttenuates, kMostOfWaves, kMostOfSlopes);
  if (!check.result().failure) check.time(make, full);
  RenderingCheck result = check.result();
  result.largest_of_waves = check.largest_of_volume();
  return result;
}

std::size_t rays_per_dispatch(double samples_per_second) {
  constexpr double kSeconds = 0.25, kSamplesOfALongRay = 1000.0;
  constexpr double kLeast = 1 << 16, kMost = 1 << 24;
  return static_cast<std::size_t>(std::clamp(kSeconds * samples_per_second / kSamplesOfALongRay, kLeast, kMost));
}

}  // namespace isoshift
