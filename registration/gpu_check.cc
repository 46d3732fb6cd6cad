#include "registration/gpu_check.h"

#include <fmt/format.h>

#include <map>

#include "base/error.h"
#include "base/option_name.h"
#include "base/stopwatch.h"
#include "drr/gl/context.h"
#include "drr/raycast/raycast.h"

namespace isoshift {
namespace {

GpuCheck check_of(const GlChoice& choice) {
  GlContext& context = gl_context(choice);
  GpuCheck check{.device = context.renderer(), .driver = context.version()};
  const Stopwatch watch;
  try {
    const RendererOptions options{.gl = choice};
    check.rendering = check_rendering([&](const auto& ct_hu, const auto& model, auto beams) {
      return std::make_unique<RaycastGlRenderer>(ct_hu, model, beams, options);
    });
    check.similarity = check_similarities(context);
    for (const auto& failure : {check.rendering.failure, check.similarity.failure})
      if (failure && !check.failure)
        check.failure = fmt::format("{} failed its self-check: {}", check.device, *failure);
  } catch (const Error& error) {
    check.failure = fmt::format("{} failed its self-check: {}", check.device, error.what());
  }
  check.milliseconds = 1000.0 * watch.seconds();
  return check;
}

}  // namespace

std::string GpuCheck::words() const {
  if (failure) return *failure;
  return fmt::format("passed, line integrals within {:.1g} (rms {:.1g}) of the largest, similarities within {:.1g}",
                     rendering.largest, rendering.rms, similarity.largest);
}

const GpuCheck& gpu_check(const GlChoice& choice) {
  static std::map<const GlContext*, GpuCheck> known;
  const GlContext* context = &gl_context(choice);
  const auto at = known.find(context);
  return at != known.end() ? at->second : known.emplace(context, check_of(choice)).first->second;
}

void require_gpu_check(const GlChoice& choice) {
  if (const auto& failure = gpu_check(choice).failure)
    throw Error(
        fmt::format("{}.\n"
                    "       Use {}, and tell the maker of the driver",
                    *failure, option("renderer", "cpu")));
}

}  // namespace isoshift
