#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>

#include "base/error.h"
#include "base/output_folder.h"
#include "cli/commands/commands.h"
#include "cli/commands/inspect_bodies.h"
#include "drr/gl/context.h"
#include "io/study/study.h"
#include "registration/gpu_check.h"
#include "workflow/register/rendering_options.h"
#include "workflow/register/study_bodies.h"
#include "workflow/register/study_options.h"

namespace isoshift {
namespace {

std::string or_missing(const std::optional<double>& value, std::string_view unit) {
  return value ? fmt::format("{:.6g} {}", *value, unit) : "missing";
}

template <class Vector>
std::string or_missing(const std::optional<Vector>& value, std::string_view unit) {
  return value ? fmt::format("({:.6g}) {}", fmt::join(*value, ", "), unit) : "missing";
}

std::string or_missing(const std::optional<std::string>& value) { return value ? *value : "missing"; }

// An angle that registration takes as 0 where no X-ray of the session has it.
std::string or_taken_as_0(const std::optional<double>& angle_deg, std::string_view flag) {
  return angle_deg ? or_missing(angle_deg, "deg") : fmt::format("missing, taken as 0 without {} DEG", flag);
}

std::string line(std::string_view name, std::string_view value) { return fmt::format("  {:<24} {}\n", name, value); }

// The source and the panel's center in the room: what the angles and distances mean once put together.
std::string geometry_as_understood(const RtImage& image) {
  Notes notes;
  const XrayView view = xray_view(image, Beam::kKilovoltage, notes);
  const Ray center = view.ray(0.5 * (view.columns - 1), 0.5 * (view.rows - 1));
  std::string text =
      line("source, IEC fixed", fmt::format("({:.2f}) mm", fmt::join(view.source_room_mm, ", "))) +
      line("panel center, IEC fixed", fmt::format("({:.2f}) mm", fmt::join(center.pixel_room_mm, ", "))) +
      line("isocenter at pixel", fmt::format("({:.2f}) column, row; counted from 0",
                                             fmt::join(view.project(Eigen::Vector3d::Zero()).value(), ", ")));
  for (const std::string& warning : notes.warnings) text += line("note", warning);
  return text;
}

std::string describe_rt_image(RtImage image, const std::optional<std::string>& planned_position,
                              const std::optional<MachineProfile>& machine) {
  Notes applied;
  if (machine) image = with_machine(image, *machine, {}, applied);
  if (!image.patient_position) image.patient_position = planned_position;
  std::string text =
      fmt::format("{} \"{}\", {}\n", image.is_rt_image() ? "RT Image" : "X-ray", image.label, image.path.string());
  text +=
      line("image type", image.image_type) + line("pixels", fmt::format("{} x {}", image.columns, image.rows)) +
      line("values origin", or_missing(image.reported_values_origin)) +
      line("SAD, SID", or_missing(image.sad_mm, "mm") + ", " + or_missing(image.sid_mm, "mm")) +
      line("gantry angle", or_missing(image.gantry_angle_deg, "deg")) +
      line("couch angle", or_missing(image.table.support_angle_deg, "deg")) +
      line("couch pitch", or_taken_as_0(image.table.pitch_deg, "--couch-pitch")) +
      line("couch roll", or_taken_as_0(image.table.roll_deg, "--couch-roll")) +
      line("receptor translation", or_missing(image.receptor_translation_mm, "mm")) +
      line("receptor angle", or_missing(image.receptor_angle_deg, "deg")) +
      line("pixel spacing", or_missing(image.pixel_spacing_mm, "mm, rows then columns")) +
      line("RT Image Position", or_missing(image.position_mm, "mm")) +
      line("collimator angle", or_missing(image.collimator_angle_deg, "deg")) +
      line("jaws and leaves", described(image.jaws)) + line("patient position", or_missing(image.patient_position)) +
      line("intensity",
           or_missing(image.intensity_relationship) + ", sign " +
               (image.intensity_sign ? fmt::format("{:+}", *image.intensity_sign) : std::string("missing"))) +
      line("KVP", or_missing(image.kvp, "kV")) + line("frame of reference", or_missing(image.frame_of_reference_uid)) +
      line("isocenter in that frame", or_missing(image.isocenter_mm, "mm")) +
      line("acquired", or_missing(image.acquisition_date) + " " + or_missing(image.acquisition_time));
  for (const std::string& applied_override : applied.overrides) text += line("profile", applied_override);
  if (image.imager && !image.imager->is_corrected)
    text += line("profile", "the imager's errors are not corrected; they widen the uncertainty of every registration");
  for (const std::string& problem : image.jaws.problems) text += line("note", problem);
  const auto missing = missing_attributes(image);
  for (const MissingAttribute& attribute : missing)
    text += line("MISSING", fmt::format("{}; {}", described(attribute.tag),
                                        attribute.supplied_by.empty() ? "no switch supplies it"
                                                                      : "supplied by " + attribute.supplied_by));
  // What stands in the way is told, not thrown: inspecting is for files that registration refuses, too.
  try {
    for (const Finding& finding : rt_image_findings(image))
      text += line("CHECK", fmt::format("{}; allowed by --allow {}=REASON", finding.message, finding.key));
    const bool has_geometry = image.pixel_from_room || (image.plane && image.pixel_spacing_mm && image.position_mm &&
                                                        image.sad_mm && image.sid_mm && image.gantry_angle_deg);
    if (has_geometry) text += geometry_as_understood(image);
  } catch (const Error& error) {
    text += line("REFUSED", error.what());
  }
  return text + "\n";
}

std::string describe_plan(const std::filesystem::path& path) {
  const RtPlan plan = read_rt_plan(path);
  std::string text = fmt::format("RT Plan \"{}\", {}\n", plan.label, path.string()) +
                     line("approval", plan.approval_status.empty() ? "missing" : plan.approval_status) +
                     line("frame of reference", or_missing(plan.frame_of_reference_uid));
  for (const RtPlan::Beam& beam : plan.beams)
    text += line(fmt::format("beam {} \"{}\"", beam.number, beam.name),
                 fmt::format("isocenter {}, {}, couch {}; jaws and leaves {}",
                             or_missing(beam.isocenter_patient_mm, "mm"), or_missing(beam.patient_position),
                             or_missing(beam.support_angle_deg, "deg"), described(beam.jaws)));
  for (const RtPlan::Beam& beam : plan.beams)
    for (const std::string& problem : beam.jaws.problems) text += line("note", problem);
  return text + "\n";
}

std::string describe_structures(const std::filesystem::path& path) {
  try {
    const RtStructures read = read_rt_structures(path);
    std::string text = fmt::format("RT Structure Set \"{}\", {}\n", read.label, path.string());
    for (const Structure& structure : read.structures)
      text += line(fmt::format("structure {} \"{}\"", structure.number, structure.name),
                   fmt::format("{}, {} closed contours{}",
                               structure.interpreted_type.empty() ? "type missing" : structure.interpreted_type,
                               structure.contours.size(),
                               structure.ignored_contours == 0
                                   ? ""
                                   : fmt::format(", {} that {} nothing", structure.ignored_contours,
                                                 structure.ignored_contours == 1 ? "encloses" : "enclose")));
    return text + "\n";
  } catch (const Error& error) {
    return fmt::format("RT Structure Set, {}\n", path.string()) + line("REFUSED", error.what()) + "\n";
  }
}

std::string describe_ct(const std::string& series_uid, const std::vector<std::filesystem::path>& files,
                        Console& console) {
  std::string text = fmt::format("CT series {}\n", series_uid) +
                     line("slices", fmt::format("{}, from {}", files.size(), files.front().parent_path().string()));
  Notes notes;
  try {
    ProgressBar bar(console, "Reading CT");
    const CtSeries ct = read_ct_series(files, {{"gaps", "inspection"}}, notes,
                                       [&](std::size_t done, std::size_t total) { bar.update(done, total); });
    const Eigen::Vector3d first = ct.hu.patient_from_voxel.translation();
    const Eigen::Vector3d last = ct.hu.patient_from_voxel * Eigen::Vector3d((ct.hu.size.array() - 1).cast<double>());
    text += line("voxels", fmt::format("{}, spacing ({:.4g}) mm", fmt::join(ct.hu.size, " x "),
                                       fmt::join(ct.hu.spacing_mm(), ", "))) +
            line("first voxel, patient", fmt::format("({:.2f}) mm", fmt::join(first, ", "))) +
            line("last voxel, patient", fmt::format("({:.2f}) mm", fmt::join(last, ", "))) +
            line("frame of reference", ct.frame_of_reference_uid);
  } catch (const Error& error) {
    text += line("REFUSED", error.what());
  }
  for (const std::string& note : notes.overrides) text += line("CHECK", note);
  for (const std::string& note : notes.warnings) text += line("note", note);
  return text + "\n";
}

// The bodies of every CT: a picture each, and a table.
void run_inspect_bodies(const std::vector<std::filesystem::path>& paths, const std::filesystem::path& folder,
                        bool overwrite, Console& console) {
  OutputFolder output(folder, overwrite);
  const StudyFiles files = scan_study(paths);
  if (files.cts.empty()) throw Error(fmt::format("{}: holds no CT", paths.front().string()));
  std::string listing;
  for (std::size_t n = 0; n < files.cts.size(); ++n) {
    Notes notes;
    CtSeries ct;
    {
      ProgressBar bar(console, "Reading CT");
      ct = read_ct_series(files.cts[n].files, {{"gaps", "inspection"}}, notes,
                          [&](std::size_t done, std::size_t total) { bar.update(done, total); });
    }
    std::vector<DrawnBone> drawn;
    for (const auto& structures : files.structures)
      for (DrawnBone& bone : drawn_bones(read_rt_structures(structures.file), ct)) drawn.push_back(std::move(bone));
    const BodyMap map = find_bodies(ct.hu, drawn);
    const std::string name = files.cts.size() == 1 ? "bodies" : fmt::format("bodies{}", n + 1);
    const std::string title = fmt::format("CT series {}: {} bodies", ct.series_instance_uid, map.bodies.size());
    if (!map.labels.voxels.empty()) write_text(output.path() / (name + ".png"), bodies_picture(map, title));
    write_text(output.path() / (name + ".txt"), title + "\n" + bodies_table(map));
    listing += title + "\n" + bodies_table(map);
  }
  output.commit();
  console.out << listing;
}

void run_inspect(const std::vector<std::filesystem::path>& paths, const std::optional<MachineProfile>& machine,
                 Console& console) {
  const StudyFiles files = scan_study(paths);
  std::optional<std::string> planned_position;
  for (const StudyFiles::Plan& found : files.plans) {
    console.out << describe_plan(found.file);
    const RtPlan plan = read_rt_plan(found.file);
    planned_position = common_patient_position(plan, plan.beams);
  }
  for (const StudyFiles::Ct& ct : files.cts) console.out << describe_ct(ct.series_instance_uid, ct.files, console);
  for (const auto& images : {files.images, files.other_xrays})
    for (const StudyFiles::Image& file : images) {
      Notes notes;
      for (const RtImage& image : read_rt_images(file.file, notes))
        console.out << describe_rt_image(image, planned_position, machine);
      for (const std::string& warning : notes.warnings) console.out << "note: " << warning << "\n";
    }
  for (const auto& structures : files.structures) console.out << describe_structures(structures.file);
  for (const std::string& file : files.left_aside) console.out << "left aside: " << file << "\n";
  for (const std::string& reason : files.unreadable) console.out << "unreadable: " << reason << "\n";
  if (!files.unreadable.empty())
    throw Error(fmt::format("{} of the files cannot be read; see above", files.unreadable.size()));
  if (files.cts.empty() && files.images.empty() && files.other_xrays.empty() && files.plans.empty() &&
      files.structures.empty())
    throw Error(fmt::format("{}: holds nothing that isoshift can read", paths.front().string()));
}

// A device as --gl and --device would open it: its driver, its limits, and whether it can be trusted.
void print_device(const GlChoice& choice, Console& console) {
  const bool is_gpu = choice.kind == GlDevice::kHardware;
  try {
    const GlContext& context = gl_context(choice);
    console.out << fmt::format("OpenGL, {}: {}, {}, OpenGL {}{}\n", is_gpu ? "hardware" : "software",
                               context.device_name(), context.renderer(), context.version(),
                               is_gpu ? "" : " (only with --gl software)");
    if (is_gpu) console.out << fmt::format("  UUID: {}\n", context.uuid().empty() ? "not told" : context.uuid());
    console.out << fmt::format("  Limits: volumes of {} voxels along an edge, {} MB of images at once\n",
                               context.largest_volume_edge(), context.largest_buffer_bytes() / 1'000'000)
                << fmt::format("  A lost context: {}\n", context.is_robust() ? "is an error" : "may not be told")
                << fmt::format("  Self-check: {} ({:.0f} ms)\n", gpu_check(choice).words(),
                               gpu_check(choice).milliseconds);
  } catch (const Error& error) {
    const std::string reason = error.what();
    console.out << fmt::format("OpenGL, {}: none; {}\n", is_gpu ? "hardware" : "software",
                               reason.substr(0, reason.find('\n')));
  }
}

void run_inspect_devices(Console& console) {
  const int gpus = count_gpus();
  for (int gpu = 0; gpu < gpus; ++gpu) print_device({GlDevice::kHardware, std::to_string(gpu)}, console);
  if (gpus == 0) print_device(GlDevice::kHardware, console);
  print_device(GlDevice::kSoftware, console);
  const std::optional<std::string> why_cpu = RenderingOptions().why_cpu();
  console.out << (why_cpu ? fmt::format("--renderer auto is cpu: {}\n", *why_cpu) : "--renderer auto is raycast\n");
}

}  // namespace

void add_inspect_command(CLI::App& app, Console& console, int&) {
  struct Options {
    std::vector<std::filesystem::path> paths;
    std::filesystem::path machine, machine_key, bodies;
    bool devices = false, overwrite = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "inspect", "Show what files contain, how their geometry is understood, and every missing attribute");
  command->footer(
      "\nExample:\n  isoshift inspect exported/\n  isoshift inspect RTIMAGE/KV_AP.dcm\n  isoshift inspect exported/ "
      "--bodies "
      "bodies\n  isoshift inspect --devices");
  auto* paths = command->add_option("path", options->paths, "Files or folders")->type_name("PATH");
  command->add_option("--machine", options->machine, "Machine profile to apply to the X-rays before they are shown")
      ->type_name("FILE");
  command->add_option("--machine-key", options->machine_key, "Public key by which the profile must be signed")
      ->type_name("FILE");
  auto* bodies = command
                     ->add_option("--bodies", options->bodies,
                                  "Find the rigid bodies that the CT shows, draw and list them in this folder")
                     ->type_name("FOLDER");
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier output in that folder")->needs(bodies);
  auto* devices = command->add_flag("--devices", options->devices, "List the devices that can render");
  command->require_option(1, 0);
  paths->excludes(devices);
  bodies->needs(paths);
  command->callback([options, &console] {
    if (!options->bodies.empty())
      return run_inspect_bodies(options->paths, options->bodies, options->overwrite, console);
    if (!options->devices)
      return run_inspect(options->paths, named_machine(options->machine, options->machine_key), console);
    run_inspect_devices(console);
  });
}

}  // namespace isoshift
