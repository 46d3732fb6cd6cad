#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "base/error.h"
#include "base/output_folder.h"
#include "cli/commands/commands.h"
#include "cli/switches/rendering_switches.h"
#include "cli/switches/study_switches.h"
#include "io/objects/drr_image.h"
#include "io/objects/image_files.h"
#include "io/report/view_picture.h"
#include "workflow/register/start_pose.h"

namespace isoshift {
namespace {

struct DrrOptions {
  StudyOptions study;
  RenderingOptions rendering;
  std::filesystem::path output;
  std::filesystem::path setup_error;     // empty: the planned pose
  std::vector<double> source_isocenter;  // of a Spatial Registration in it
  bool dicom = false;
  bool overwrite = false;
};

// Distances on the receptor between neighboring columns and rows.
std::array<double, 2> pixel_size_mm(const XrayView& view) {
  const Eigen::Vector3d first = view.ray(0, 0).pixel_room_mm;
  return {(view.ray(1, 0).pixel_room_mm - first).norm(), (view.ray(0, 1).pixel_room_mm - first).norm()};
}

void run_drr(const DrrOptions& options, Console& console) {
  std::vector<std::filesystem::path> inputs = options.study.parts.paths();
  inputs.push_back(options.setup_error);
  OutputFolder output(options.output, options.overwrite, inputs);
  Notes notes;
  options.rendering.check();
  ConsoleObserver observer(console);
  const Study study = load(options.study, notes, observer);
  const Eigen::Isometry3d setup_error =
      options.setup_error.empty() ? Eigen::Isometry3d::Identity()
                                  : read_start(options.setup_error, study, options.source_isocenter, notes).setup_error;
  const auto renderer = make_renderer(options.rendering.kind(), study.ct->hu, options.rendering.model(),
                                      beams_of(study), options.rendering.options());
  const std::array pose = {setup_error * study.planned_room_from_patient};
  notes.warnings.insert(notes.warnings.end(), study.doubts.begin(), study.doubts.end());
  print_warnings(notes.warnings, console);

  std::string listing = fmt::format("rendered by {} on {}", to_string(renderer->kind()), renderer->device());
  for (auto [name, value] : options.rendering.settings()) {
    std::ranges::replace(name, '_', ' ');
    listing += fmt::format(", {} {}", name, value);
  }
  listing += fmt::format("; attenuation {}, threshold {:.0f} HU\n", options.rendering.attenuation_name(),
                         options.rendering.threshold_hu);
  const std::string series_instance_uid = new_uid();
  for (std::size_t n = 0; n < study.xrays.size(); ++n) {
    const XrayView& view = study.xrays[n].view;
    const RenderResult drrs = renderer->render(std::span(&view, 1), pose, PixelSet::all());
    const Image<float> image = image_of(view, drrs.line_integrals(0, 0));
    require_not_empty(image.pixels, study.xrays[n].label);
    const std::string name = fmt::format("drr{}", n + 1);
    write_text(output.path() / (name + ".png"), png_of(radiograph(image)));
    write_mha(output.path() / (name + ".mha"), image, pixel_size_mm(view));
    if (options.dicom)
      write_drr_image(study, n, image, setup_error, series_instance_uid, output.path() / (name + ".dcm"));
    listing += fmt::format("{}.png {}.mha {} {}: {} x {} pixels, line integrals up to {:.3f}\n", name, name,
                           options.dicom ? name + ".dcm " : "", study.xrays[n].label, view.columns, view.rows,
                           *std::ranges::max_element(image.pixels));
  }
  output.commit();
  console.out << listing;
}

}  // namespace

void add_drr_command(CLI::App& app, Console& console, int&) {
  auto options = std::make_shared<DrrOptions>();
  CLI::App* command = app.add_subcommand("drr", "Render DRRs: what the X-rays of a study should show");
  command->footer(
      "\nExample:\n  isoshift drr exported/ -o drr                               # patient as planned\n"
      "  isoshift drr exported/ -o drr --setup-error out/result.json  # patient as found\n\n"
      "Writes a picture (PNG) and the line integrals (MetaImage) per X-ray of the study, with --dicom an RT Image, "
      "too.");
  add_study_options(*command, options->study);
  command->add_option("-o,--output", options->output, "Folder for the images")->required()->type_name("FOLDER");
  auto* setup_error =
      command->add_option("--setup-error", options->setup_error,
                          "result.json, truth.json, a Spatial Registration of any program or an ITK transform (.tfm): "
                          "how the patient lies");
  setup_error->type_name("FILE");
  add_source_isocenter_option(*command, options->source_isocenter)->needs(setup_error);
  command->add_flag("--dicom", options->dicom, "Write DICOM RT Images (image type DRR), too");
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier output in that folder");
  add_rendering_options(*command, options->rendering);
  command->callback([options, &console] { run_drr(*options, console); });
}

}  // namespace isoshift
