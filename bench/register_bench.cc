// One whole registration of two 768 x 768 views, from 10 mm and 3 degrees off plan, after loading.

#include <benchmark/benchmark.h>

#include "bench/scene.h"
#include "drr/gl/context.h"
#include "registration/presets.h"

namespace isoshift {
namespace {

void register_two_views(benchmark::State& state, const char* name, RendererKind kind, GlDevice gl) {
  if (uses_gl(kind) && gl == GlDevice::kHardware && !has_hardware_gl()) return state.SkipWithError("no GPU here");
  const RendererPyramid renderers(kind, bench_ct(), {}, std::array{Beam::kKilovoltage}, {.gl = gl});
  Placement placement;
  placement.translation_mm = Eigen::Vector3d(6, -6, 5);
  placement.rotation_deg = Eigen::Vector3d(2, -1.5, 1.5);
  std::vector<XrayImage> xrays;
  for (const double gantry_deg : {0.0, 90.0}) {
    XrayImage xray;
    xray.view = bench_view(gantry_deg, 768);
    xray.values = simulate_xray(head_phantom(Eigen::Vector3d::Zero(), 1), placement,
                                {.gantry_angle_deg = gantry_deg, .pixels = 768, .pixel_mm = 410.0 / 768}, 20000.0, 1);
    xrays.push_back(std::move(xray));
  }
  Eigen::Isometry3d planned = Eigen::Isometry3d::Identity();  // HFS: (x, y, z) of the room is (x, z, -y) of the patient
  planned.linear() << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  register_views(renderers, prepared(xrays), planned, preset(name));  // compiles shaders
  double evaluations = 0.0, rendering = 0.0, similarity = 0.0, seconds = 0.0;
  for (auto _ : state) {
    RegistrationResult result = register_views(renderers, prepared(xrays), planned, preset(name));
    evaluations = result.evaluations();
    rendering += result.seconds_rendering;
    similarity += result.seconds_similarity;
    seconds += result.seconds;
    benchmark::DoNotOptimize(result);
  }
  state.counters["evaluations"] = evaluations;
  state.counters["rendering_share"] = rendering / seconds;  // of the search; checks render, too
  state.counters["similarity_share"] = similarity / seconds;
}

const bool kRegistered = [] {
  struct On {
    const char* suffix;
    RendererKind kind;
    GlDevice gl;
  };
  for (const char* name : {"setup", "fast", "paper"})
    for (const On& on : {On{"", RendererKind::kCpu, GlDevice::kHardware},
                         On{"/raycast_software", RendererKind::kRaycast, GlDevice::kSoftware},
                         On{"/raycast_hardware", RendererKind::kRaycast, GlDevice::kHardware}})
      benchmark::RegisterBenchmark((std::string("register_two_views/") + name + on.suffix).c_str(), register_two_views,
                                   name, on.kind, on.gl)
          ->UseRealTime()
          ->Unit(benchmark::kMillisecond)
          ->Iterations(5);
  return true;
}();

}  // namespace
}  // namespace isoshift
