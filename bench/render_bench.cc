// One DRR of a head CT by every renderer, and how the time of `cpu` and `raycast` grows: with the pixels, with the
// share of pixels drawn at random, with the path through the body, with the bits per voxel and the instruction set.
// bench/plot_scaling.py draws it.

#include <benchmark/benchmark.h>
#include <hwy/highway.h>

#include "bench/scene.h"
#include "drr/gl/context.h"

namespace isoshift {
namespace {

// A block of water, `depth_mm` along the central axis and 160 mm across, in voxels of 1 mm: every ray of the view runs
// through all of it.
Volume<float> water_block(int depth_mm) {
  const Eigen::Vector3i size(160, 160, depth_mm);
  Eigen::Affine3d patient_from_voxel = Eigen::Affine3d::Identity();
  patient_from_voxel.translation() = -0.5 * (size.array() - 1).cast<double>();
  return {size, patient_from_voxel, 0.0F};
}

// The same panel as bench_view(), but 150 mm of it: inside the block's shadow.
XrayView narrow_view() {
  XrayView view = bench_view(0.0, 512);
  Eigen::Matrix3d wider = Eigen::Matrix3d::Identity();
  const double zoom = 410.0 / 150.0, middle = 0.5 * (512 - 1);
  wider << zoom, 0, middle * (1 - zoom), 0, zoom, middle * (1 - zoom), 0, 0, 1;
  view.pixel_from_room = wider * view.pixel_from_room;
  return view;
}

void time_render(benchmark::State& state, Renderer& renderer, const XrayView& view, const PixelSet& pixels) {
  const Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (auto _ : state) {
    const RenderResult drr = renderer.render(std::span(&view, 1), std::span(&pose, 1), pixels);
    benchmark::DoNotOptimize(drr.line_integrals(0, 0).data());
  }
  state.counters["rays/s"] = benchmark::Counter(static_cast<double>(pixels.count(std::span(&view, 1), 0)),
                                                benchmark::Counter::kIsIterationInvariantRate);
  if (const auto gpu_seconds = renderer.gpu_seconds()) state.counters["gpu_ms"] = 1e3 * *gpu_seconds;
}

bool lacks_gl(benchmark::State& state, RendererKind kind, GlDevice gl) {
  if (!uses_gl(kind) || gl == GlDevice::kSoftware || has_hardware_gl()) return false;
  state.SkipWithError("no GPU here");
  return true;
}

const Volume<float>& head() {
  static const Volume<float> ct = bench_ct();
  return ct;
}

std::unique_ptr<Renderer> make(RendererKind kind, GlDevice gl, const Volume<float>& ct,
                               VolumePrecision precision = kDefaultPrecision) {
  RendererOptions options{.gl = gl};
  if (!is_oracle(kind)) options.precision = precision;
  return make_renderer(kind, ct, {}, std::array{Beam::kKilovoltage}, options);
}

void every_renderer(benchmark::State& state, RendererKind kind, GlDevice gl) {
  if (lacks_gl(state, kind, gl)) return;
  time_render(state, *make(kind, gl, head()), bench_view(30.0, 512), PixelSet::all());
}

void pixels_along_an_edge(benchmark::State& state, RendererKind kind, GlDevice gl) {
  if (lacks_gl(state, kind, gl)) return;
  time_render(state, *make(kind, gl, head()), bench_view(30.0, static_cast<int>(state.range(0))), PixelSet::all());
}

void percent_of_the_pixels(benchmark::State& state, RendererKind kind, GlDevice gl) {
  if (lacks_gl(state, kind, gl)) return;
  const XrayView view = bench_view(30.0, 512);
  time_render(state, *make(kind, gl, head()), view,
              PixelSet::random(std::span(&view, 1), 0.01 * static_cast<double>(state.range(0)), 1));
}

void mm_of_path(benchmark::State& state, RendererKind kind, GlDevice gl) {
  if (lacks_gl(state, kind, gl)) return;
  time_render(state, *make(kind, gl, water_block(static_cast<int>(state.range(0)))), narrow_view(), PixelSet::all());
}

void bits_per_voxel(benchmark::State& state, VolumePrecision precision) {
  time_render(state, *make(RendererKind::kCpu, GlDevice::kHardware, head(), precision), bench_view(30.0, 512),
              PixelSet::all());
}

// What processors without this machine's best vectors would take, as far as one can tell from here.
void instruction_set(benchmark::State& state, std::int64_t target) {
  hwy::SetSupportedTargetsForTest(target);
  hwy::GetChosenTarget().DeInit();
  const auto renderer = make(RendererKind::kCpu, GlDevice::kHardware, head());
  if (renderer->device().ends_with(hwy::TargetName(target)))
    time_render(state, *renderer, bench_view(30.0, 512), PixelSet::all());
  else
    state.SkipWithError("not compiled for this one");
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().DeInit();
}

// 64 poses x 2 views x 5 % of 512 x 512 pixels: in one call, and in 128.
void batch(benchmark::State& state, RendererKind kind, GlDevice gl, bool in_one_call) {
  if (lacks_gl(state, kind, gl)) return;
  const auto renderer = make(kind, gl, head());
  const std::vector<XrayView> views = {bench_view(0.0, 512), bench_view(90.0, 512)};
  const PixelSet pixels = PixelSet::random(views, 0.05, 1);
  std::vector<Eigen::Isometry3d> poses(64, Eigen::Isometry3d::Identity());
  for (std::size_t n = 0; n < poses.size(); ++n) poses[n].translation().x() = 0.1 * static_cast<double>(n);
  for (auto _ : state) {
    if (in_one_call) {
      benchmark::DoNotOptimize(renderer->render(views, poses, pixels));
      continue;
    }
    for (const Eigen::Isometry3d& pose : poses)
      for (std::size_t v = 0; v < views.size(); ++v)
        benchmark::DoNotOptimize(
            renderer->render(std::span(&views[v], 1), std::span(&pose, 1), {.of_view = {pixels.of_view[v]}}));
  }
}

void add(const std::string& name, const auto& function) {
  benchmark::RegisterBenchmark(name.c_str(), function)->UseRealTime()->Unit(benchmark::kMillisecond);
}

const bool kRegistered = [] {
  for (const RendererKind kind : kRendererKinds) {
    const std::string name(to_string(kind));
    if (!uses_gl(kind)) {
      add("every_renderer/" + name, [=](auto& state) { every_renderer(state, kind, GlDevice::kHardware); });
      continue;
    }
    add("every_renderer/" + name + "_software", [=](auto& state) { every_renderer(state, kind, GlDevice::kSoftware); });
    add("every_renderer/" + name + "_hardware", [=](auto& state) { every_renderer(state, kind, GlDevice::kHardware); });
  }
  for (const VolumePrecision precision : kVolumePrecisions)
    add("bits_per_voxel/cpu_" + std::string(to_string(precision)),
        [=](auto& state) { bits_per_voxel(state, precision); });
  for (std::int64_t rest = hwy::SupportedTargets(); rest != 0; rest &= rest - 1)
    add(std::string("instruction_set/cpu_") + hwy::TargetName(rest & -rest),
        [target = rest & -rest](auto& state) { instruction_set(state, target); });
  struct Scaled {
    const char* name;
    RendererKind kind;
    GlDevice gl;
  };
  for (const Scaled& of : {Scaled{"cpu", RendererKind::kCpu, GlDevice::kHardware},
                           Scaled{"raycast_software", RendererKind::kRaycast, GlDevice::kSoftware},
                           Scaled{"raycast_hardware", RendererKind::kRaycast, GlDevice::kHardware}}) {
    const auto with_ranges = [&](const char* what, void (*function)(benchmark::State&, RendererKind, GlDevice),
                                 const std::vector<std::int64_t>& values) {
      auto* added = benchmark::RegisterBenchmark((std::string(what) + "/" + of.name).c_str(), function, of.kind, of.gl);
      for (const std::int64_t value : values) added->Arg(value);
      added->UseRealTime()->Unit(benchmark::kMillisecond);
    };
    with_ranges("pixels_along_an_edge", pixels_along_an_edge, {64, 128, 256, 384, 512, 768, 1024});
    with_ranges("percent_of_the_pixels", percent_of_the_pixels, {1, 5, 10, 25, 50, 100});
    with_ranges("mm_of_path", mm_of_path, {25, 50, 100, 150, 200, 300, 400});
    add(std::string("batch/") + of.name + "_one_call", [=](auto& state) { batch(state, of.kind, of.gl, true); });
    add(std::string("batch/") + of.name + "_128_calls", [=](auto& state) { batch(state, of.kind, of.gl, false); });
  }
  return true;
}();

}  // namespace
}  // namespace isoshift
