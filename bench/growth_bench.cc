// How the time of `cpu` grows with the poses, views, bodies, voxels and threads of a call; its growth with pixels is in
// render_bench.cc. bench/plot_scaling.py draws all of it.

#include <benchmark/benchmark.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <thread>

#include "bench/scene.h"
#include "drr/bodies.h"

namespace isoshift {
namespace {

constexpr double kShare = 0.05;  // of the pixels of 512 x 512: what a stage of a search compares

std::vector<Eigen::Isometry3d> moved_poses(std::int64_t count) {
  std::vector<Eigen::Isometry3d> poses(static_cast<std::size_t>(count), Eigen::Isometry3d::Identity());
  for (std::size_t n = 0; n < poses.size(); ++n) poses[n].translation().x() = 0.1 * static_cast<double>(n);
  return poses;
}

std::unique_ptr<Renderer> renderer_of(const Volume<float>& ct_hu) {
  return make_renderer(RendererKind::kCpu, ct_hu, {}, std::array{Beam::kKilovoltage});
}

Renderer& head_renderer() {
  static const std::unique_ptr<Renderer> renderer = renderer_of(bench_ct());
  return *renderer;
}

void time_call(benchmark::State& state, Renderer& renderer, std::int64_t views, std::int64_t poses) {
  std::vector<XrayView> from;
  for (std::int64_t n = 0; n < views; ++n) from.push_back(bench_view(30.0 + 25.0 * static_cast<double>(n), 512));
  const PixelSet pixels = PixelSet::random(from, kShare, 1);
  const std::vector<Eigen::Isometry3d> at = moved_poses(poses);
  for (auto _ : state) benchmark::DoNotOptimize(renderer.render(from, at, pixels));
}

void poses_in_a_call(benchmark::State& state) { time_call(state, head_renderer(), 1, state.range(0)); }
void views_in_a_call(benchmark::State& state) { time_call(state, head_renderer(), state.range(0), 1); }

// Water in waves that fill a cube of 192 mm, so that no voxel is passed over.
void voxels_along_an_edge(benchmark::State& state) {
  const auto edge = static_cast<int>(state.range(0));
  constexpr double kEdgeMm = 192.0;
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
  patient_from_voxel.linear() *= kEdgeMm / edge;
  patient_from_voxel.translation().setConstant(-0.5 * kEdgeMm * (edge - 1) / edge);
  Volume<float> ct(Eigen::Vector3i::Constant(edge), patient_from_voxel);
  std::vector<float> wave(static_cast<std::size_t>(edge));
  for (std::size_t n = 0; n < wave.size(); ++n)
    wave[n] = static_cast<float>(100.0 * std::sin(8.0 * std::numbers::pi * static_cast<double>(n) / edge));
  for (int k = 0; k < edge; ++k)
    for (int j = 0; j < edge; ++j)
      for (int i = 0; i < edge; ++i)
        ct.at(i, j, k) =
            wave[static_cast<std::size_t>(i)] + wave[static_cast<std::size_t>(j)] + wave[static_cast<std::size_t>(k)];
  const std::unique_ptr<Renderer> renderer = renderer_of(ct);
  time_call(state, *renderer, 1, 1);
}

// The head in slabs of equal height, each a body of its own, with derivatives.
void bodies_of_a_patient(benchmark::State& state) {
  const auto count = static_cast<int>(state.range(0));
  const Volume<float> ct = bench_ct();
  std::vector<BodyShare> shares;
  for (int body = 0; body < count; ++body) {
    const int first = ct.size.z() * body / count, end = ct.size.z() * (body + 1) / count;
    const Eigen::Affine3d lattice = ct.patient_from_voxel * Eigen::Translation3d(0.0, 0.0, first);
    shares.emplace_back(Eigen::Vector3i(ct.size.x(), ct.size.y(), end - first), lattice, std::uint8_t{255});
  }
  const BodyRenderers renderers(RendererKind::kCpu, ct, {}, std::array{Beam::kKilovoltage}, shares);
  const XrayView view = bench_view(30.0, 512);
  const std::vector<std::uint32_t> pixels = PixelSet::random(std::span(&view, 1), kShare, 1).of_view.front();
  const Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (auto _ : state)
    for (std::size_t body = 0; body < renderers.count(); ++body)
      benchmark::DoNotOptimize(renderers.part_with_derivatives(body, view, pose, pixels));
}

void threads(benchmark::State& state) {
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(state.range(0)));
  time_call(state, head_renderer(), 2, 16);
}

void powers_of_two(benchmark::internal::Benchmark* benchmark, std::int64_t last) {
  for (std::int64_t n = 1; n <= last; n *= 2) benchmark->Arg(n);
}

void as_measured(benchmark::internal::Benchmark* benchmark) { benchmark->UseRealTime()->Unit(benchmark::kMillisecond); }

BENCHMARK(poses_in_a_call)->Apply(as_measured)->Apply([](auto* b) { powers_of_two(b, 64); });
BENCHMARK(views_in_a_call)->Apply(as_measured)->DenseRange(1, 8);
BENCHMARK(bodies_of_a_patient)->Apply(as_measured)->Apply([](auto* b) { powers_of_two(b, 32); });
BENCHMARK(voxels_along_an_edge)->Apply(as_measured)->Arg(128)->Arg(192)->Arg(256)->Arg(384)->Arg(512)->Arg(768);
BENCHMARK(threads)->Apply(as_measured)->Apply([](auto* b) {
  powers_of_two(b, std::max(1U, std::thread::hardware_concurrency()));
});

}  // namespace
}  // namespace isoshift
