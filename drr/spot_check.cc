#include "drr/spot_check.h"

#include <fmt/format.h>

#include <cmath>

#include "base/option_name.h"
#include "drr/cpu/trilinear.h"

namespace isoshift {
namespace {

constexpr double kRays = 500.0;
constexpr std::uint64_t kSeedOfPixels = 1;
// On the phantoms of testdata/ 16 bits leave 0.0002 and 8 bits 0.006; volumes half a voxel beside leave 0.0125 and more
// (docs/renderers.md, "Before a GPU is trusted").
constexpr double kMostRms = 0.01;

}  // namespace

std::string SpotCheck::words() const {
  return failure ? *failure : fmt::format("{} rays within {:.2g} % (rms)", rays, 100.0 * rms);
}

SpotCheck check_rays(Renderer& renderer, const Volume<float>& ct_hu, const AttenuationModel& model,
                     std::span<const XrayView> views, const Eigen::Isometry3d& room_from_patient) {
  double all_pixels = 0.0;
  for (const XrayView& view : views) all_pixels += static_cast<double>(view.columns) * view.rows;
  const PixelSet pixels = PixelSet::random(views, kRays / all_pixels, kSeedOfPixels);
  const RenderResult drrs = renderer.render(views, std::span(&room_from_patient, 1), pixels);
  SpotCheck check;
  double squares = 0.0, squares_of_differences = 0.0;
  for (std::size_t view = 0; view < views.size(); ++view) {
    const std::vector<double> exact =
        exact_line_integrals(ct_hu, model, views[view], room_from_patient, pixels.of_view[view]);
    for (std::size_t n = 0; n < exact.size(); ++n) {
      const double difference = drrs.line_integrals(0, view)[n] - exact[n];
      squares += exact[n] * exact[n];
      squares_of_differences += difference * difference;
    }
    check.rays += exact.size();
  }
  check.rms = squares > 0.0 ? std::sqrt(squares_of_differences / squares) : squares_of_differences;
  if (!(check.rms <= kMostRms))
    check.failure = fmt::format(
        "{} rays of the DRRs differ from those of the CPU by {:.2g} % (rms), expected at most {:.1f} %: the GPU or its "
        "driver computes something else, or the voxels are stored too coarsely ({})",
        check.rays, 100.0 * check.rms, 100.0 * kMostRms, option("precision"));
  return check;
}

}  // namespace isoshift
