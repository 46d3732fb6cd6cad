#include "cli/commands/bench_table1.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <memory>
#include <span>
#include <thread>

#include "base/error.h"
#include "base/mean_and_sd.h"
#include "base/version.h"
#include "cli/commands/bench_scene.h"
#include "cli/commands/table1_folder.h"
#include "drr/gl/context.h"
#include "workflow/register/rendering_options.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::uint64_t kTable1PixelSeed = 1;

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

// The paper's thresholds, 20 and 70 of 255 for the spine, 10 and 60 for the pig, as HU of the window: low + n / 255
// (high - low), to the nearest 10 (docs/founding-paper.md).
constexpr std::array<std::array<double, 2>, 2> kThresholdsHu = {{{-380.0, 20.0}, {-460.0, -60.0}}};

// Errors are those of 5 % of the pixels at 30 poses. 899 has no factor in common with 30: all axes turn.
constexpr int kErrorPoses = 30, kErrorEvery = 899;
constexpr double kErrorPixelShare = 0.05;

struct Timing {
  MeanAndSd wall_ms;                // of render(): until the pixels are in memory
  std::optional<MeanAndSd> gpu_ms;  // by the GPU's clock, without transfers from it
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
  Timing timing{.wall_ms = mean_and_sd_of(wall_ms), .gpu_ms = std::nullopt};
  if (!gpu_ms.empty()) timing.gpu_ms = mean_and_sd_of(gpu_ms);
  return timing;
}

double share_above(const Volume<float>& hu, double threshold_hu) {
  const auto count = std::ranges::count_if(hu.voxels, [&](float value) { return value >= threshold_hu; });
  return static_cast<double>(count) / static_cast<double>(hu.voxels.size());
}

// Otherwise no image would show anything.
void require_any_above(const BenchVolume& volume, double threshold_hu) {
  if (share_above(volume.hu, threshold_hu) == 0.0)
    throw Error(
        fmt::format("{}: holds nothing above {:g} HU, the threshold of a cell of Table 1", volume.name, threshold_hu));
}

std::string processor_name() {
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);)
    if (line.starts_with("model name")) return line.substr(line.find(':') + 2);
  return "unknown processor";
}

Json json_of(const MeanAndSd& ms) { return {{"mean", ms.mean}, {"sd", ms.sd}}; }

// One volume at one threshold.
class Cell {
 public:
  Cell(const Table1Options& options, const BenchVolume& volume, double threshold_hu)
      : options_(options), volume_(volume), model_(paper_model(threshold_hu)), view_(table1_view(options.pixels)) {}

  Json header() const {
    const Eigen::Vector3i& size = volume_.hu.size;
    return {{"volume", volume_.name},
            {"voxels", {size.x(), size.y(), size.z()}},
            {"threshold_hu", model_.threshold_hu},
            {"share_above", share_above(volume_.hu, model_.threshold_hu)}};
  }

  Json measure(const Method& method) {
    Renderer& renderer = renderer_for(method);
    const std::vector<Eigen::Isometry3d> poses = bench_poses(volume_.hu, options_.every);
    const PixelSet pixels = method.pixel_share == 1.0
                                ? PixelSet::all()
                                : PixelSet::random(std::span(&view_, 1), method.pixel_share, kTable1PixelSeed);
    const Timing timing = time_of(renderer, view_, poses, pixels);
    return {{"method", method.name},
            {"renderer", to_string(method.kind)},
            {"device", renderer.device()},
            {"poses", poses.size()},
            {"every", options_.every},
            {"wall_ms", json_of(timing.wall_ms)},
            {"gpu_ms", timing.gpu_ms ? json_of(*timing.gpu_ms) : Json(nullptr)},
            {"rms_error", rms_error(renderer, std::min<std::size_t>(kErrorPoses, poses.size()))}};
  }

 private:
  // Rows of one renderer follow each other.
  Renderer& renderer_for(const Method& method) {
    if (made_for_ == nullptr || made_for_->kind != method.kind || made_for_->block_edge != method.block_edge) {
      renderer_.reset();  // never two in memory
      renderer_ = make_renderer(method.kind, volume_.hu, model_, std::array{view_.beam},
                                {.gl = gl_choice_from(options_.gl, options_.gpu),
                                 .precision = VolumePrecision::kU8,
                                 .block_edge = method.block_edge});
      made_for_ = &method;
    }
    return *renderer_;
  }

  // Root mean square of the differences from `trilinear`, as a share of that of its line integrals.
  double rms_error(Renderer& renderer, std::size_t poses) {
    const std::vector<Eigen::Isometry3d> all = bench_poses(volume_.hu, kErrorEvery);
    const PixelSet pixels = PixelSet::random(std::span(&view_, 1), kErrorPixelShare, kTable1PixelSeed);
    if (exact_.empty()) {
      const auto oracle = make_renderer(RendererKind::kTrilinear, volume_.hu, model_, std::array{view_.beam});
      for (std::size_t n = 0; n < poses; ++n)
        exact_.push_back(oracle->render(std::span(&view_, 1), std::span(&all[n], 1), pixels));
    }
    double squares = 0.0, squares_off = 0.0;
    for (std::size_t n = 0; n < poses; ++n) {
      const RenderResult rendered = renderer.render(std::span(&view_, 1), std::span(&all[n], 1), pixels);
      const auto exact = exact_[n].line_integrals(0, 0), found = rendered.line_integrals(0, 0);
      for (std::size_t pixel = 0; pixel < exact.size(); ++pixel) {
        squares += std::pow(exact[pixel], 2);
        squares_off += std::pow(found[pixel] - exact[pixel], 2);
      }
    }
    return std::sqrt(squares_off / squares);
  }

  const Table1Options& options_;
  const BenchVolume& volume_;
  AttenuationModel model_;
  XrayView view_;
  const Method* made_for_ = nullptr;
  std::unique_ptr<Renderer> renderer_;
  std::vector<RenderResult> exact_;  // of every pose at which errors are taken
};

// A row that is kept and wanted must be of the poses that are wanted.
void require_poses(const Json& row, const Table1Options& options) {
  if (const int every = row.at("every").get<int>(); every != options.every)
    throw Error(
        fmt::format("{}: its row \"{}\" has every {}th of the poses, and --every {} is wanted.\n       Choose "
                    "another folder with -o",
                    options.output.string(), row.at("method").get<std::string>(), every, options.every));
}

// All rows by OpenGL are of one device: of that which renders now, or else of the first row.
class OneDevice {
 public:
  explicit OneDevice(const Table1Options& options) : folder_(options.output) {
    if (std::ranges::any_of(kMethods, [&](const Method& one) { return uses_gl(one.kind) && options.wants(one.kind); }))
      device_ = gl_context(gl_choice_from(options.gl, options.gpu)).renderer();
  }

  void require_of(const Json& row, const Method& method) {
    if (!uses_gl(method.kind)) return;
    const auto device = row.at("device").get<std::string>();
    if (device_.empty()) device_ = device;
    if (device != device_)
      throw Error(
          fmt::format("{}: its row \"{}\" is of the device {}, and others are of {}.\n       Choose another folder "
                      "with -o",
                      folder_.string(), method.name, device, device_));
  }

 private:
  std::filesystem::path folder_;
  std::string device_;
};

std::string in_words(const Json& ms) {
  return ms.is_null() ? fmt::format("{:>22}", "-")
                      : fmt::format("{:9.2f} +/- {:8.2f}", ms.at("mean").get<double>(), ms.at("sd").get<double>());
}

}  // namespace

bool Table1Options::wants(RendererKind kind) const {
  return renderers.empty() || std::ranges::find(renderers, to_string(kind)) != renderers.end();
}

AttenuationModel paper_model(double threshold_hu) {
  return {.kind = AttenuationModel::Kind::kWindowed, .threshold_hu = threshold_hu};
}

Json table1(const Table1Options& options, const std::function<void(double share)>& progress,
            const std::function<void(const Json& cell)>& on_cell) {
  const AttenuationModel model = paper_model(0.0);
  const Json kept = {{"program", {{"name", "isoshift"}, {"version", kVersion}, {"commit", kCommit}}},
                     {"machine", {{"processor", processor_name()}, {"threads", std::thread::hardware_concurrency()}}},
                     {"protocol",
                      {{"pixels", options.pixels},
                       {"precision", "u8"},
                       {"attenuation", "windowed"},
                       {"window_hu", {model.window_low_hu, model.window_high_hu}}}}};
  const Table1Folder folder(options.output, kept);
  const auto wanted = std::ranges::count_if(kMethods, [&](const Method& method) { return options.wants(method.kind); });
  const double work = static_cast<double>(wanted) * 2.0 * kThresholdsHu.size();
  double done = 0.0;
  Json result = kept;
  result["protocol"]["poses"] = (kBenchPoses + options.every - 1) / options.every;
  result["protocol"]["every"] = options.every;
  result["tables"] = Json::array();
  OneDevice device(options);
  const std::array volumes = {bench_spine(), bench_head(options.ct)};
  for (std::size_t n = 0; n < volumes.size(); ++n)
    for (const double threshold_hu : kThresholdsHu[n]) require_any_above(volumes[n], threshold_hu);
  for (std::size_t n = 0; n < volumes.size(); ++n) {
    for (const double threshold_hu : kThresholdsHu[n]) {
      Cell cell(options, volumes[n], threshold_hu);
      const Json header = cell.header();
      Json table = header;
      table["rows"] = Json::array();
      for (const Method& method : kMethods) {
        std::optional<Json> row = folder.find(header, method.name);
        if (options.wants(method.kind)) {
          if (row)
            require_poses(*row, options);
          else
            folder.keep(header, *(row = cell.measure(method)));
          progress(++done / work);
        }
        if (!row) continue;
        device.require_of(*row, method);
        table["rows"].push_back(*std::move(row));
      }
      on_cell(table);
      result["tables"].push_back(std::move(table));
    }
  }
  return result;
}

std::string table1_text(const Json& cell) {
  const Json& voxels = cell.at("voxels");
  std::string text = fmt::format(
      "\n{}, {} x {} x {} voxels, threshold {:+.0f} HU: {:.1f} % of the voxels above\n{:<42}{:>22}{:>22}{:>10}{:>8}\n",
      cell.at("volume").get<std::string>(), voxels[0].get<int>(), voxels[1].get<int>(), voxels[2].get<int>(),
      cell.at("threshold_hu").get<double>(), 100.0 * cell.at("share_above").get<double>(), "ms per image, mean +/- SD",
      "wall", "GPU", "error", "poses");
  for (const Json& row : cell.at("rows"))
    text +=
        fmt::format("{:<42}{}{}{:>8.3f} %{:>8}\n", row.at("method").get<std::string>(), in_words(row.at("wall_ms")),
                    in_words(row.at("gpu_ms")), 100.0 * row.at("rms_error").get<double>(), row.at("poses").get<int>());
  return text;
}

}  // namespace isoshift
