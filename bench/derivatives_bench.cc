// What derivatives cost, and what they save. A DRR with derivatives beside one without; and the last stage of `setup`
// from several distances, climbed on values (BOBYQA) and on derivatives (Levenberg-Marquardt). Costs are counted in
// equivalent DRRs: the time, divided by that of one evaluation without derivatives of the same pixels.

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <chrono>
#include <random>
#include <vector>

#include "bench/scene.h"
#include "geometry/rotation.h"
#include "registration/objective.h"
#include "registration/pose_parameters.h"
#include "registration/presets.h"

namespace isoshift {
namespace {

using Clock = std::chrono::steady_clock;
double seconds_since(Clock::time_point begin) { return std::chrono::duration<double>(Clock::now() - begin).count(); }

struct Scene {
  RendererPyramid renderers{RendererKind::kCpu, bench_ct(), {}, std::array{Beam::kKilovoltage}};
  std::vector<FixedImage> images;
  Eigen::Isometry3d planned = Eigen::Isometry3d::Identity();
  ProjectedRegion everything;

  Scene() {
    planned.linear() << 1, 0, 0, 0, 0, 1, 0, -1, 0;  // HFS: (x, y, z) of the room is (x, z, -y) of the patient
    for (const double gantry_deg : {0.0, 90.0}) {
      XrayImage xray;
      xray.view = bench_view(gantry_deg, 768);
      xray.values = simulate_xray(head_phantom(Eigen::Vector3d::Zero(), 1), {},
                                  {.gantry_angle_deg = gantry_deg, .pixels = 768, .pixel_mm = 410.0 / 768}, 20000.0, 1);
      images.push_back(prepare(xray));
    }
  }
};

const Scene& scene() {
  static const Scene made;
  return made;
}

void drr_with_derivatives(benchmark::State& state) {
  const Stage fine = preset("setup").stages.back();
  const FixedViews views{.images = scene().images, .region = scene().everything};
  Objective objective(scene().renderers.with_voxels_up_to(fine.voxel_mm),
                      views.reduced_to(fine.pixel_mm, scene().planned, 0.0), scene().planned,
                      {.similarity = fine.similarity,
                       .pixel_fraction = fine.pixel_fraction,
                       .min_pixels = static_cast<std::size_t>(fine.min_pixels)});
  const std::array pose = {scene().planned};
  double plain = 0.0, with = 0.0;
  for (auto _ : state) {
    const auto begin = Clock::now();
    benchmark::DoNotOptimize(objective.values(pose));
    plain += seconds_since(begin);
    const auto middle = Clock::now();
    benchmark::DoNotOptimize(objective.models(pose));
    with += seconds_since(middle);
  }
  state.counters["equivalent_drrs"] = with / plain;
}
BENCHMARK(drr_with_derivatives)->UseRealTime()->Unit(benchmark::kMillisecond)->Iterations(30);

// One stage of `setup` from `state.range(0)` tenths of a millimeter, six directions.
void climb_stage(benchmark::State& state, const char* name, OptimizerKind optimizer) {
  Stage stage;
  for (const Stage& one : preset("setup").stages)
    if (one.name == name) stage = one;
  stage.optimizer = optimizer;
  stage.starts = stage.keep = 1;
  stage.candidates = 0;
  const FixedViews views{.images = scene().images, .region = scene().everything};
  double evaluations = 0.0, seconds = 0.0, plain = 0.0, error_mm = 0.0, runs = 0.0;
  for (auto _ : state)
    for (int direction = 0; direction < 6; ++direction) {
      std::mt19937_64 random(static_cast<std::uint64_t>(direction) + 1);
      std::normal_distribution<double> normal;
      std::vector<double> start(6);
      for (double& parameter : start) parameter = normal(random);
      const double length = Eigen::Map<Eigen::VectorXd>(start.data(), 6).norm();
      for (double& parameter : start) parameter *= 0.1 * static_cast<double>(state.range(0)) / length;
      const std::array one = {setup_error_from_parameters(start) * scene().planned};
      Objective objective(scene().renderers.with_voxels_up_to(stage.voxel_mm),
                          views.reduced_to(stage.pixel_mm, one.front(), stage.initial_step_mm), one.front(),
                          {.similarity = stage.similarity,
                           .pixel_fraction = stage.pixel_fraction,
                           .min_pixels = static_cast<std::size_t>(stage.min_pixels)});
      objective.values(one);
      const auto begin = Clock::now();
      for (int n = 0; n < 5; ++n) benchmark::DoNotOptimize(objective.values(one));
      plain += seconds_since(begin) / 5.0;
      const SearchResult found =
          search(scene().renderers, views, scene().planned, {.stages = {stage}, .parameters = start});
      seconds += found.seconds_rendering + found.seconds_similarity;
      evaluations += found.stages.front().evaluations;
      error_mm += distance_between(found.parameters, std::vector<double>(6)).translation_mm;
      runs += 1.0;
    }
  state.counters["evaluations"] = evaluations / runs;
  state.counters["equivalent_drrs"] = seconds / plain;
  state.counters["error_mm"] = error_mm / runs;
}
const bool kRegistered = [] {
  struct Climbed {
    const char* stage;
    std::vector<OptimizerKind> optimizers;
    std::vector<std::int64_t> tenths_mm;
  };
  for (const auto& [stage, optimizers, tenths_mm] :
       {Climbed{"fine", {OptimizerKind::kBobyqa, OptimizerKind::kLevenbergMarquardt}, {4, 10, 20}},
        Climbed{
            "medium", {OptimizerKind::kBobyqa, OptimizerKind::kLevenbergMarquardt, OptimizerKind::kLbfgs}, {10, 40}}})
    for (const OptimizerKind optimizer : optimizers)
      for (const std::int64_t distance : tenths_mm)
        benchmark::RegisterBenchmark(fmt::format("climb_stage/{}/{}", stage, to_string(optimizer)).c_str(), climb_stage,
                                     stage, optimizer)
            ->Arg(distance)
            ->UseRealTime()
            ->Unit(benchmark::kMillisecond)
            ->Iterations(1);
  return true;
}();

}  // namespace
}  // namespace isoshift
