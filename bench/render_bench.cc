// One DRR of 512 x 512 pixels from a head CT, by every renderer; rays and pixels per second beside the time.

#include <benchmark/benchmark.h>

#include "bench/scene.h"
#include "drr/gl/context.h"

namespace isoshift {
namespace {

void render_drr(benchmark::State& state, RendererKind kind, int pixels, GlDevice gl = GlDevice::kHardware) {
  if (kind == RendererKind::kRaycast && gl == GlDevice::kHardware && !has_hardware_gl()) {
    state.SkipWithError("no GPU here");
    return;
  }
  static const Volume<float> ct = bench_ct();
  const auto renderer = make_renderer(kind, ct, {}, std::array{Beam::kKilovoltage}, {.gl = gl});
  const XrayView view = bench_view(30.0, pixels);
  const Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (auto _ : state) {
    const RenderResult drr = renderer->render(std::span(&view, 1), std::span(&pose, 1), PixelSet::all());
    benchmark::DoNotOptimize(drr.line_integrals(0, 0).data());
  }
  state.counters["pixels/s"] =
      benchmark::Counter(static_cast<double>(pixels) * pixels, benchmark::Counter::kIsIterationInvariantRate);
}

BENCHMARK_CAPTURE(render_drr, siddon, RendererKind::kSiddon, 512)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(render_drr, trilinear, RendererKind::kTrilinear, 512)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(render_drr, cpu, RendererKind::kCpu, 512)->UseRealTime()->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(render_drr, raycast_software, RendererKind::kRaycast, 512, GlDevice::kSoftware)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK_CAPTURE(render_drr, raycast_hardware, RendererKind::kRaycast, 512, GlDevice::kHardware)
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace isoshift
