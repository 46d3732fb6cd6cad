#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/error.h"
#include "base/output_folder.h"
#include "cli/commands/commands.h"
#include "io/study/motion_trace.h"
#include "phantom/study_writer.h"

namespace isoshift {
namespace {

struct PhantomCommandOptions {
  PhantomOptions phantom;
  std::filesystem::path output;
  std::string anatomy = "head";
  std::filesystem::path trace;
  std::vector<std::string> bends;
  std::vector<double> translation_mm = {4.3, -6.1, 3.2};
  std::vector<double> rotation_deg = {1.4, -2.1, 1.8};
  std::vector<double> panel_shift_mm = {0.0, 0.0};
  std::vector<double> panel_turn_deg = {0.0, 0.0, 0.0};
  bool overwrite = false;
};

void run_phantom(PhantomCommandOptions options, Console& console) {
  PhantomOptions& phantom = options.phantom;
  using enum PhantomOptions::Anatomy;
  for (const auto anatomy : {kHead, kSpine, kThorax, kBalls})
    if (anatomy_name(anatomy) == options.anatomy) phantom.anatomy = anatomy;
  phantom.panel_fault = {.shift_mm = Eigen::Vector2d(options.panel_shift_mm.data()),
                         .turn_deg = Eigen::Vector3d(options.panel_turn_deg.data())};
  for (const std::string& bend : options.bends) phantom.bends.push_back(Bend::from_text(bend));
  Notes notes;
  if (!options.trace.empty()) phantom.breathing.trace = read_motion_trace(options.trace, notes);
  print_warnings(notes.warnings, console);
  phantom.placement.isocenter_patient_mm = Eigen::Vector3d(-12.5, 38.0, -410.0);
  phantom.placement.translation_mm = Eigen::Vector3d(options.translation_mm.data());
  phantom.placement.rotation_deg = Eigen::Vector3d(options.rotation_deg.data());
  phantom.check();
  OutputFolder output(options.output, options.overwrite, {options.trace});
  {
    ProgressBar bar(console, "Writing phantom");
    write_phantom_study(phantom, output.path(), [&](std::size_t done, std::size_t total) { bar.update(done, total); });
  }
  output.commit();
  console.out << fmt::format(
      "{}: {} phantom study, seed {}; off plan by ({:.2f}) mm and ({:.2f}) degrees about x, y, z\n",
      options.output.string(), options.anatomy, phantom.seed, fmt::join(options.translation_mm, ", "),
      fmt::join(options.rotation_deg, ", "));
}

}  // namespace

// NOLINTNEXTLINE(readability-function-size): long because the command has many flags, one after the other
void add_phantom_command(CLI::App& app, Console& console, int&) {
  auto options = std::make_shared<PhantomCommandOptions>();
  CLI::App* command = app.add_subcommand("phantom", "Make a digital phantom study whose setup error is known");
  command->footer(
      "\nExample:\n  isoshift phantom -o study --translation 5,0,-3 --rotation 1,0,2\n"
      "  isoshift register study -o result --truth study/truth.json\n"
      "  isoshift phantom -o bent --anatomy spine --bend spine:4,weight-loss:10\n"
      "  isoshift phantom -o breathing --anatomy thorax --breathing 30 --image-pixels 192 --voxel-mm 2 --translation "
      "0,0,0 --rotation 0,0,0");
  command->add_option("-o,--output", options->output, "Folder to make")->required()->type_name("FOLDER");
  command
      ->add_option("--anatomy", options->anatomy,
                   "Part of the body, or steel balls in a block for the geometry of imagers")
      ->check(CLI::IsMember({"head", "spine", "thorax", "balls"}))
      ->capture_default_str();
  command->add_option("--translation", options->translation_mm, "Setup error, mm, IEC 61217 fixed")
      ->delimiter(',')
      ->expected(3)
      ->type_name("X,Y,Z")
      ->capture_default_str();
  command->add_option("--rotation", options->rotation_deg, "Setup error about x, y, z in degrees, R = Rz Rx Ry")
      ->delimiter(',')
      ->expected(3)
      ->type_name("RX,RY,RZ")
      ->capture_default_str();
  command->add_option("--patient-position", options->phantom.placement.patient_position, "How the patient lies")
      ->check(CLI::IsMember({"HFS", "HFP", "FFS", "FFP", "HFDR", "HFDL", "FFDR", "FFDL"}))
      ->capture_default_str();
  command->add_option("--couch-angle", options->phantom.placement.couch_angle_deg, "Patient support angle, IEC 61217")
      ->type_name("DEG")
      ->capture_default_str();
  command->add_option("--gantry-angles", options->phantom.gantry_angles_deg, "One X-ray is taken at each")
      ->delimiter(',')
      ->type_name("DEG,...")
      ->capture_default_str();
  command
      ->add_option("--receptor-angle", options->phantom.receptor_angle_deg,
                   "X-Ray Image Receptor Angle: the panel's turn about the central ray, IEC 61217")
      ->type_name("DEG")
      ->capture_default_str();
  command
      ->add_option("--panel-shift", options->panel_shift_mm,
                   "How far the panel really lies off along the gantry's x and y, mm: the X-rays' files do not say so")
      ->delimiter(',')
      ->expected(2)
      ->type_name("X,Y");
  command
      ->add_option("--panel-turn", options->panel_turn_deg,
                   "The same about the gantry's x and y (tilts) and z (roll), degrees")
      ->delimiter(',')
      ->expected(3)
      ->type_name("RX,RY,RZ");
  command->add_option("--ct-tilt", options->phantom.ct_tilt_deg, "Tilt of the CT's slices about the patient's x axis")
      ->type_name("DEG")
      ->capture_default_str();
  command
      ->add_option("--voxel-mm", options->phantom.voxel_mm, "Pixel size of the CT; its slices are 1.5 times as thick")
      ->type_name("MM")
      ->capture_default_str();
  command->add_option("--image-pixels", options->phantom.image_pixels, "Pixels along each edge of an X-ray")
      ->capture_default_str();
  command->add_option("--photons", options->phantom.photons, "Photons per open pixel; 0 for no noise")
      ->capture_default_str();
  command
      ->add_option("--mv-angles", options->phantom.megavoltage_angles_deg,
                   "Gantry angles at which the X-rays are taken with 6 MV")
      ->delimiter(',')
      ->type_name("DEG,...");
  command
      ->add_option("--breathing", options->phantom.breathing.seconds,
                   "Let a thorax breathe for this time: X-rays over time, a 4D CT and truth.csv")
      ->type_name("S");
  command->add_option("--rate", options->phantom.breathing.rate_hz, "Moments per second")
      ->type_name("HZ")
      ->capture_default_str();
  command->add_option("--phases", options->phantom.breathing.phases, "Phases of the 4D CT")
      ->check(CLI::Range(0, 20))
      ->capture_default_str();
  command
      ->add_option("--trace", options->trace,
                   "Move the target as recorded in this trace (t_s or Timestamp; x, y, z in patient axes, mm), "
                   "relative to the trace's first position")
      ->type_name("CSV");
  command
      ->add_option("--bend", options->bends,
                   "Bend the patient against the CT: neck, spine, jaw (degrees), shoulders, weight-loss (mm), "
                   "missing-couch, extra-couch; truth.json then has the motion of every body")
      ->delimiter(',')
      ->type_name("KIND[:AMOUNT],...");
  command
      ->add_option("--fractions", options->phantom.fractions,
                   "Days of treatment, each with X-rays and a random setup error of its own")
      ->type_name("N")
      ->capture_default_str();
  command->add_option("--seed", options->phantom.seed, "Seed of the anatomy, the noise and the UIDs")
      ->capture_default_str();
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier study in that folder");
  command->callback([options, &console] { run_phantom(*options, console); });
}

}  // namespace isoshift
