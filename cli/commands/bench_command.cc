// isoshift bench: the founding paper's Table 1 and its figures, on this machine.

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <fstream>
#include <functional>
#include <memory>
#include <nlohmann/json.hpp>
#include <thread>

#include "base/output_folder.h"
#include "base/version.h"
#include "cli/commands/bench_scene.h"
#include "cli/commands/commands.h"
#include "cli/switches/rendering_switches.h"
#include "drr/raycast/rasterized.h"
#include "geometry/rotation.h"
#include "io/report/drawings.h"
#include "io/report/view_picture.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::array kThresholdsHu = {-540.0, 200.0};
constexpr std::uint64_t kPixelSeed = 1;

// A row of Table 1, or of ours.
struct Method {
  const char* name;
  RendererKind kind;
  double pixel_share;
  int block_edge = 2;
};
constexpr std::array kMethods = {
    Method{"wobbled splatting, basic", RendererKind::kSplat, 1.0},
    Method{"wobbled splatting, noise texture", RendererKind::kSplatTexture, 1.0},
    Method{"wobbled splatting, vertex buffer objects", RendererKind::kSplatBuffers, 1.0},
    Method{"ray casting, basic", RendererKind::kRaycastBox, 1.0},
    Method{"ray casting, cuberille 64 voxels", RendererKind::kRaycastCuberille, 1.0, 4},
    Method{"ray casting, cuberille 8 voxels", RendererKind::kRaycastCuberille, 1.0, 2},
    Method{"ray casting, sparse 50 %", RendererKind::kRaycastBox, 0.5},
    Method{"ray casting, sparse 25 %", RendererKind::kRaycastBox, 0.25},
    Method{"ray casting, cuberille 8 + sparse 25 %", RendererKind::kRaycastCuberille, 0.25, 2},
    Method{"ours: ray casting, sparse 5 %", RendererKind::kRaycastBox, 0.05},
    Method{"ours: compute", RendererKind::kRaycast, 1.0},
    Method{"ours: compute, sparse 25 %", RendererKind::kRaycast, 0.25},
    Method{"ours: compute, sparse 5 %", RendererKind::kRaycast, 0.05},
    Method{"ours: cpu", RendererKind::kCpu, 1.0},
    Method{"ours: cpu, sparse 25 %", RendererKind::kCpu, 0.25},
    Method{"ours: cpu, sparse 5 %", RendererKind::kCpu, 0.05},
};

// The paper renders 8-bit volumes of windowed HU.
AttenuationModel paper_model(double threshold_hu) {
  return {.kind = AttenuationModel::Kind::kWindowed, .threshold_hu = threshold_hu};
}

struct Statistics {
  double mean = 0.0, sd = 0.0;
};

Statistics statistics_of(const std::vector<double>& values) {
  double mean = 0.0, squares = 0.0;
  for (const double value : values) mean += value / static_cast<double>(values.size());
  for (const double value : values) squares += (value - mean) * (value - mean);
  return {mean, values.size() > 1 ? std::sqrt(squares / static_cast<double>(values.size() - 1)) : 0.0};
}

struct Timing {
  Statistics wall_ms;                // of render(): until the pixels are in memory
  std::optional<Statistics> gpu_ms;  // by the GPU's clock, without transfers from it
};

Timing time_of(Renderer& renderer, const XrayView& view, std::span<const Eigen::Isometry3d> poses,
               const PixelSet& pixels) {
  std::vector<double> wall_ms, gpu_ms;
  renderer.render(std::span(&view, 1), poses.first(1), pixels);  // drivers compile at the first use
  for (const Eigen::Isometry3d& pose : poses) {
    const auto begin = std::chrono::steady_clock::now();
    renderer.render(std::span(&view, 1), std::span(&pose, 1), pixels);
    wall_ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count());
    if (const auto seconds = renderer.gpu_seconds()) gpu_ms.push_back(1e3 * *seconds);
  }
  Timing timing{.wall_ms = statistics_of(wall_ms), .gpu_ms = std::nullopt};
  if (!gpu_ms.empty()) timing.gpu_ms = statistics_of(gpu_ms);
  return timing;
}

double share_above(const Volume<float>& hu, double threshold_hu) {
  const auto count = std::ranges::count_if(hu.voxels, [&](float value) { return value >= threshold_hu; });
  return static_cast<double>(count) / static_cast<double>(hu.voxels.size());
}

std::string processor_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "unknown processor";
}

struct BenchDrrOptions {
  std::filesystem::path ct;
  std::optional<std::string> gl, gpu;
  std::vector<std::string> renderers;  // empty: all
  int every = 997;                     // not a divisor of 27,000: all axes turn
  int pixels = 512;
  bool json = false;

  bool wants(RendererKind kind) const {
    return renderers.empty() || std::ranges::find(renderers, to_string(kind)) != renderers.end();
  }
};

std::string cell(const std::optional<Statistics>& ms) {
  return ms ? fmt::format("{:9.2f} +/- {:8.2f}", ms->mean, ms->sd) : fmt::format("{:>22}", "-");
}

Json json_of(const Statistics& ms) { return {{"mean", ms.mean}, {"sd", ms.sd}}; }

// One volume at one threshold: appends its table to `table`, and returns it.
Json bench_cell(const BenchDrrOptions& options, const BenchVolume& volume, double threshold_hu,
                const std::function<void()>& progress, std::string& table) {
  const XrayView view = table1_view(options.pixels);
  const std::vector<Eigen::Isometry3d> poses = bench_poses(volume.hu, options.every);
  const double above = share_above(volume.hu, threshold_hu);
  table +=
      fmt::format("\n{}, {} x {} x {} voxels, threshold {:+.0f} HU: {:.1f} % of the voxels above\n{:<42}{:>22}{:>22}\n",
                  volume.name, volume.hu.size.x(), volume.hu.size.y(), volume.hu.size.z(), threshold_hu, 100.0 * above,
                  "ms per image, mean +/- SD", "wall", "GPU");
  Json result = {
      {"volume", volume.name}, {"threshold_hu", threshold_hu}, {"share_above", above}, {"rows", Json::array()}};
  std::unique_ptr<Renderer> renderer;
  const Method* made_for = nullptr;
  for (const Method& method : kMethods) {
    if (!options.wants(method.kind)) continue;
    if (made_for == nullptr || made_for->kind != method.kind || made_for->block_edge != method.block_edge) {
      renderer.reset();
      renderer = make_renderer(method.kind, volume.hu, paper_model(threshold_hu), std::array{view.beam},
                               {.gl = gl_choice_from(options.gl, options.gpu),
                                .precision = VolumePrecision::kU8,
                                .block_edge = method.block_edge});
      made_for = &method;
    }
    const PixelSet pixels = method.pixel_share == 1.0
                                ? PixelSet::all()
                                : PixelSet::random(std::span(&view, 1), method.pixel_share, kPixelSeed);
    const Timing timing = time_of(*renderer, view, poses, pixels);
    table += fmt::format("{:<42}{}{}\n", method.name, cell(timing.wall_ms), cell(timing.gpu_ms));
    result["rows"].push_back({{"method", method.name},
                              {"renderer", to_string(method.kind)},
                              {"device", renderer->device()},
                              {"wall_ms", json_of(timing.wall_ms)},
                              {"gpu_ms", timing.gpu_ms ? json_of(*timing.gpu_ms) : Json(nullptr)}});
    progress();
  }
  return result;
}

void run_bench_drr(const BenchDrrOptions& options, Console& console) {
  const auto wanted = std::ranges::count_if(kMethods, [&](const Method& method) { return options.wants(method.kind); });
  const double work = static_cast<double>(wanted) * kThresholdsHu.size() * 2;
  double done = 0.0;
  Json json = {{"program", {{"name", "isoshift"}, {"version", kVersion}, {"commit", kCommit}}},
               {"machine", {{"processor", processor_name()}, {"threads", std::thread::hardware_concurrency()}}},
               {"protocol",
                {{"poses", (kBenchPoses + options.every - 1) / options.every},
                 {"every", options.every},
                 {"pixels", options.pixels},
                 {"precision", "u8"},
                 {"attenuation", "windowed"}}},
               {"tables", Json::array()}};
  if (!options.json)
    console.out << fmt::format("{}, {} threads; {} of {} poses, {} x {} pixels, 8 bit voxels\n", processor_name(),
                               std::thread::hardware_concurrency(), json["protocol"]["poses"].get<int>(), kBenchPoses,
                               options.pixels, options.pixels);
  {
    ProgressBar bar(console, "Rendering");
    const auto progress = [&] { bar.update(++done / work); };
    for (const bool spine : {true, false}) {
      const BenchVolume volume = spine ? bench_spine() : bench_head(options.ct);
      for (const double threshold_hu : kThresholdsHu) {
        std::string table;
        json["tables"].push_back(bench_cell(options, volume, threshold_hu, progress, table));
        if (!options.json) console.out << table << std::flush;
      }
    }
  }
  if (options.json) console.out << json.dump(2) << "\n";
}

struct BenchFiguresOptions {
  std::filesystem::path ct, output;
  std::optional<std::string> gl, gpu;
  bool overwrite = false;
};

// Position on the bounding structure as red, green and blue; white where there is none.
Image<Rgb> colored(const Image<std::array<float, 3>>& positions) {
  Image<Rgb> picture(positions.columns, positions.rows, Rgb{255, 255, 255});
  for (std::size_t n = 0; n < positions.pixels.size(); ++n) {
    if (std::isnan(positions.pixels[n][0])) continue;
    for (int axis = 0; axis < 3; ++axis)
      picture.pixels[n][axis] =
          static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(positions.pixels[n][axis], 0.0F, 1.0F)));
  }
  return picture;
}

// Counterparts of Figs. 1 to 3 of the paper.
void run_bench_figures(const BenchFiguresOptions& options, Console& console) {
  OutputFolder output(options.output, options.overwrite);
  ProgressBar bar(console, "Rendering");
  const GlChoice gl = gl_choice_from(options.gl, options.gpu);
  const BenchVolume volume = bench_head(options.ct);
  const XrayView view = table1_view(512, 370.0);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  // head up, turned a little to its side
  pose.linear() = rotation_x(rad_from_deg(-90)) * rotation_z(rad_from_deg(25));
  pose.translation() = -(pose.linear() * center_of(volume.hu));
  const auto beams = std::array{view.beam};
  const AttenuationModel bone = paper_model(200.0), model = paper_model(-540.0);

  std::vector<CaptionedPicture> structures, sparse, renderers;
  for (const int edge : {1, 2, 4}) {
    RasterizedRaycaster raycaster(RendererKind::kRaycastCuberille, volume.hu, bone, beams,
                                  {.gl = gl, .block_edge = edge});
    structures.push_back({fmt::format("blocks of {} voxel{} along each edge", edge, edge == 1 ? "" : "s"),
                          colored(raycaster.front_positions(view, pose))});
  }
  bar.update(0.3);
  const auto cpu = make_renderer(RendererKind::kCpu, volume.hu, model, beams);
  for (const double share : {1.0, 0.5, 0.25, 0.05}) {
    const PixelSet pixels = PixelSet::random(std::span(&view, 1), share, kPixelSeed);
    const RenderResult result = cpu->render(std::span(&view, 1), std::span(&pose, 1), pixels);
    Image<float> image(view.columns, view.rows);
    for (std::size_t n = 0; n < pixels.of_view[0].size(); ++n)
      image.pixels[pixels.of_view[0][n]] = result.line_integrals(0, 0)[n];
    sparse.push_back({fmt::format("{:.0f} % of the pixels", 100.0 * share), in_gray(radiograph(image))});
  }
  for (const RendererKind kind : kRendererKinds) {
    const auto renderer = make_renderer(kind, volume.hu, model, beams, {.gl = gl});
    const RenderResult result = renderer->render(std::span(&view, 1), std::span(&pose, 1), PixelSet::all());
    const Image<float> image = image_of(view, result.line_integrals(0, 0));
    require_not_empty(image.pixels, to_string(kind));
    renderers.push_back({std::string(to_string(kind)), in_gray(radiograph(image))});
    bar.update(0.3 + 0.7 * static_cast<double>(renderers.size()) / kRendererKinds.size());
  }
  write_text(output.path() / "bounding_structures.png", captioned_png(structures, 3));
  write_text(output.path() / "sparse_pixels.png", captioned_png(sparse, 4));
  write_text(output.path() / "renderers.png", captioned_png(renderers, 3));
  output.commit();
  console.out << fmt::format("{}: bounding_structures.png, sparse_pixels.png, renderers.png\n",
                             options.output.string());
}

void add_ct_option(CLI::App& command, std::filesystem::path& ct) {
  command.add_option("--ct", ct, "CT series to take instead of the phantom's head")->type_name("FOLDER");
}

}  // namespace

void add_bench_command(CLI::App& app, Console& console, int&) {
  CLI::App* bench = app.add_subcommand("bench", "Measure the renderers as the founding paper did, or make its figures");
  bench->require_subcommand(1);

  auto drr = std::make_shared<BenchDrrOptions>();
  CLI::App* drr_command = bench->add_subcommand("drr", "Time per image of every renderer: Table 1 of the paper");
  drr_command->footer(
      "\nExample:\n  isoshift bench drr --gl software --every 4999    # all, on Mesa's llvmpipe, 6 poses\n"
      "  isoshift bench drr --renderer cpu --json          # one renderer, for a program\n\n"
      "Two volumes (53 and 67 MB in 8 bit), thresholds -540 and +200 HU. Wall time is that of a whole call, pixels in\n"
      "memory at its end; GPU time is by the GPU's own clock. docs/renderers.md sets the paper's figures beside ours.");
  add_ct_option(*drr_command, drr->ct);
  std::vector<std::string> kinds;
  for (const RendererKind kind : kRendererKinds)
    if (!is_oracle(kind)) kinds.emplace_back(to_string(kind));
  drr_command->add_option("--renderer", drr->renderers, "Renderers to measure; may be repeated [all]")
      ->check(CLI::IsMember(kinds));
  drr_command->add_option("--every", drr->every, "Of the 27,000 poses take every N-th")
      ->check(CLI::Range(1, kBenchPoses))
      ->capture_default_str()
      ->type_name("N");
  drr_command->add_option("--pixels", drr->pixels, "Columns and rows of the image")
      ->check(CLI::Range(16, 4096))
      ->capture_default_str()
      ->type_name("N");
  add_gl_options(*drr_command, drr->gl, drr->gpu);
  drr_command->add_flag("--json", drr->json, "Print JSON instead of tables");
  drr_command->callback([drr, &console] { run_bench_drr(*drr, console); });

  auto figures = std::make_shared<BenchFiguresOptions>();
  CLI::App* figures_command = bench->add_subcommand("figures", "Make counterparts of the paper's Figs. 1 to 3");
  figures_command->footer("\nExample:\n  isoshift bench figures --ct planning_ct/ -o figures --gl software");
  figures_command->add_option("-o,--output", figures->output, "Folder to make")->required()->type_name("FOLDER");
  add_ct_option(*figures_command, figures->ct);
  add_gl_options(*figures_command, figures->gl, figures->gpu);
  figures_command->add_flag("--overwrite", figures->overwrite, "Replace an earlier output in that folder");
  figures_command->callback([figures, &console] { run_bench_figures(*figures, console); });
}

}  // namespace isoshift
