#include "workflow/evaluate/table2_configurations.h"

#include <algorithm>
#include <array>

#include "drr/renderer.h"

namespace isoshift {
namespace {

using enum StartReading;

// Splatting: a head CT has 270 voxels per pixel of 1.5 mm at most, and 4 % of noise in their sums. All pixels are
// compared, since all are rendered.
constexpr double kSplatPixelMm = 1.5, kSplatTolerance = 0.02;

constexpr std::array kConfigurations = {
    // Similarities and readings.
    Table2Configuration{.name = "cpu-mi"},
    Table2Configuration{.name = "cpu-src", .similarity = "src"},
    Table2Configuration{.name = "cpu-mi-mtre", .reading = kMtre},
    Table2Configuration{.name = "cpu-src-mtre", .similarity = "src", .reading = kMtre},
    Table2Configuration{.name = "cpu-mi-up-to", .reading = kUpTo},
    Table2Configuration{.name = "cpu-src-up-to", .similarity = "src", .reading = kUpTo},
    Table2Configuration{.name = "cpu-mi-one-view", .is_one_view = true},
    Table2Configuration{.name = "cpu-src-one-view", .similarity = "src", .is_one_view = true},
    // Optimizers.
    Table2Configuration{.name = "cpu-mi-restarts", .searches = 3},
    Table2Configuration{.name = "cpu-mi-bobyqa", .optimizer = "bobyqa"},
    Table2Configuration{.name = "cpu-mi-newuoa", .optimizer = "newuoa"},
    Table2Configuration{.name = "cpu-mi-sbplx", .optimizer = "sbplx"},
    Table2Configuration{.name = "cpu-src-restarts", .similarity = "src", .searches = 3},
    Table2Configuration{.name = "cpu-src-bobyqa", .similarity = "src", .optimizer = "bobyqa"},
    Table2Configuration{.name = "cpu-src-newuoa", .similarity = "src", .optimizer = "newuoa"},
    Table2Configuration{.name = "cpu-src-sbplx", .similarity = "src", .optimizer = "sbplx"},
    Table2Configuration{.name = "cpu-src-levenberg-marquardt", .similarity = "src", .optimizer = "levenberg-marquardt"},
    // Renderers.
    Table2Configuration{.name = "raycast-mi", .renderer = "raycast"},
    Table2Configuration{.name = "raycast-src", .renderer = "raycast", .similarity = "src"},
    Table2Configuration{.name = "raycast-mi-one-view", .renderer = "raycast", .is_one_view = true},
    Table2Configuration{.name = "cuberille-mi", .renderer = "raycast-cuberille", .starts = 20},
    Table2Configuration{
        .name = "cuberille-mi-one-view", .renderer = "raycast-cuberille", .is_one_view = true, .starts = 20},
    Table2Configuration{.name = "splat-mi",
                        .renderer = "splat-buffers",
                        .pixel_fraction = 1.0,
                        .pixel_mm = kSplatPixelMm,
                        .relative_tolerance = kSplatTolerance,
                        .starts = 20},
    Table2Configuration{.name = "splat-mi-one-view",
                        .renderer = "splat-buffers",
                        .is_one_view = true,
                        .pixel_fraction = 1.0,
                        .pixel_mm = kSplatPixelMm,
                        .relative_tolerance = kSplatTolerance,
                        .starts = 20},
};

}  // namespace

std::span<const Table2Configuration> table2_configurations() { return kConfigurations; }

StartProtocol protocol_of(const Table2Configuration& configuration, int most) {
  StartProtocol protocol{.distance_mm = 25.0, .count = std::min(configuration.starts, most)};
  switch (configuration.reading) {
    case kTranslation:
      protocol.series = StartProtocol::Series::kPaper;
      protocol.max_rotation_rad = 0.0;
      break;
    case kMtre: protocol.series = StartProtocol::Series::kMtre; break;
    case kUpTo: protocol.series = StartProtocol::Series::kBins; break;
  }
  return protocol;
}

RegistrationRequest request_of(const Table2Configuration& configuration, const RegistrationRequest& common) {
  RegistrationRequest request = common;
  request.search.preset = "paper";
  request.search.similarity = configuration.similarity;
  request.search.optimizer = configuration.optimizer;
  request.search.searches = configuration.searches;
  request.search.pixel_fraction = configuration.pixel_fraction;
  request.search.pixel_mm = configuration.pixel_mm;
  request.search.relative_tolerance = configuration.relative_tolerance;
  request.rendering.renderer = configuration.renderer;
  if (!uses_gl(request.rendering.kind())) request.rendering.gl = request.rendering.gpu = std::nullopt;
  return request;
}

}  // namespace isoshift
