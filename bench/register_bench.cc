// One whole registration of two 768 x 768 views, from 10 mm and 3 degrees off plan, after loading.

#include <benchmark/benchmark.h>

#include "bench/scene.h"
#include "registration/presets.h"

namespace isoshift {
namespace {

void register_two_views(benchmark::State& state) {
  const RendererPyramid renderers(RendererKind::kCpu, bench_ct(), {}, std::array{Beam::kKilovoltage});
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
  double evaluations = 0.0;
  for (auto _ : state) {
    const RegistrationResult result = register_views(renderers, xrays, planned, preset("setup"));
    evaluations = result.evaluations();
    benchmark::DoNotOptimize(result);
  }
  state.counters["evaluations"] = evaluations;
}
BENCHMARK(register_two_views)->UseRealTime()->Unit(benchmark::kMillisecond)->Iterations(3);

}  // namespace
}  // namespace isoshift
