// isoshift bench: the founding paper's Table 1 and its figures, on this machine.

#include <fmt/format.h>

#include <cmath>
#include <memory>

#include "base/json_file.h"
#include "base/output_folder.h"
#include "cli/commands/bench_scene.h"
#include "cli/commands/bench_table1.h"
#include "cli/commands/commands.h"
#include "cli/switches/rendering_switches.h"
#include "drr/raycast/rasterized.h"
#include "geometry/rotation.h"
#include "io/report/drawings.h"
#include "io/report/view_picture.h"

namespace isoshift {
namespace {

constexpr std::uint64_t kPixelSeed = 1;

struct BenchDrrOptions {
  Table1Options table;
  bool json = false;
};

void run_bench_drr(const BenchDrrOptions& options, Console& console) {
  nlohmann::ordered_json result;
  {
    ProgressBar bar(console, "Rendering");
    result = table1(
        options.table, [&](double share) { bar.update(share); },
        [&](const nlohmann::ordered_json& cell) {
          if (!options.json) console.out << table1_text(cell) << std::flush;
        });
  }
  if (options.json) console.out << json_text(result);
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
  pose.translation() = -(pose.linear() * volume.hu.center_mm());
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
      "  isoshift bench drr --renderer cpu --json          # one renderer, for a program\n"
      "  isoshift bench drr --renderer cpu --every 1 -o table1    # all poses; the same command continues\n\n"
      "Two volumes (53 and 67 MB in 8 bit) at two thresholds each. Wall time is that of a whole call, pixels in "
      "memory\n"
      "at its end; GPU time is by the GPU's own clock; the error is against the renderer trilinear.\n"
      "docs/founding-paper.md sets the paper's figures beside ours.");
  add_ct_option(*drr_command, drr->table.ct);
  std::vector<std::string> kinds;
  for (const RendererKind kind : kRendererKinds)
    if (!is_oracle(kind)) kinds.emplace_back(to_string(kind));
  drr_command->add_option("--renderer", drr->table.renderers, "Renderers to measure; may be repeated [all]")
      ->check(CLI::IsMember(kinds));
  drr_command->add_option("--every", drr->table.every, "Of the 27,000 poses take every N-th")
      ->check(CLI::Range(1, kBenchPoses))
      ->capture_default_str()
      ->type_name("N");
  drr_command->add_option("--pixels", drr->table.pixels, "Columns and rows of the image")
      ->check(CLI::Range(16, 4096))
      ->capture_default_str()
      ->type_name("N");
  drr_command
      ->add_option("-o,--output", drr->table.output,
                   "Folder that keeps every row as it ends; the same command continues, others add rows")
      ->type_name("FOLDER");
  add_gl_options(*drr_command, drr->table.gl, drr->table.gpu);
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
