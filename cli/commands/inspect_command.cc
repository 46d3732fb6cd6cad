#include <fmt/format.h>
#include <fmt/ranges.h>

#include <functional>
#include <map>
#include <memory>

#include "base/error.h"
#include "base/json_file.h"
#include "base/output_folder.h"
#include "cli/commands/commands.h"
#include "cli/commands/description.h"
#include "cli/commands/inspect_bodies.h"
#include "drr/gl/context.h"
#include "geometry/rotation.h"
#include "io/objects/registration_check.h"
#include "io/objects/registration_meaning.h"
#include "io/report/canvas.h"
#include "io/study/session_choice.h"
#include "io/study/study.h"
#include "registration/gpu_check.h"
#include "workflow/register/rendering_options.h"
#include "workflow/register/study_bodies.h"
#include "workflow/register/study_options.h"

namespace isoshift {
namespace {

using Json = Description::Json;
using Remark = Description::Remark;

void remark_all(const std::vector<std::string>& texts, Remark remark, Description& description) {
  for (const std::string& text : texts) description.remark(remark, text);
}

// The source and the panel's center in the room: what the angles and distances mean once put together.
void add_geometry_as_understood(const RtImage& image, Description& description) {
  Notes notes;
  const XrayView view = xray_view(image, Beam::kKilovoltage, notes);
  const auto add = [&](std::string_view name, std::string_view key, const auto& point, std::string_view unit) {
    description.show(name, key, json_value(point), fmt::format("({:.2f}) {}", fmt::join(point, ", "), unit));
  };
  add("source, IEC fixed", "source_room_mm", view.source_room_mm, "mm");
  add("panel center, IEC fixed", "panel_center_room_mm",
      view.ray(0.5 * (view.columns - 1), 0.5 * (view.rows - 1)).pixel_room_mm, "mm");
  add("isocenter at pixel", "isocenter_column_row", view.project(Eigen::Vector3d::Zero()).value(),
      "column, row; counted from 0");
  remark_all(notes.warnings, Remark::kNote, description);
}

// An angle that registration takes as 0 where no X-ray of the session has it.
std::string taken_as_0(std::string_view flag) { return fmt::format("missing, taken as 0 without {} DEG", flag); }

// `planned_position`: of the patient, where the image's plan is there.
void add_attributes(const RtImage& image, const std::optional<std::string>& planned_position,
                    Description& description) {
  description.show("image type", "image_type", image.image_type, image.image_type);
  description.show("pixels", "pixels", {image.columns, image.rows}, fmt::format("{} x {}", image.columns, image.rows));
  description.add("values origin", "reported_values_origin", image.reported_values_origin);
  // A projection matrix replaces what the file says of source and receptor, which may be that of the linac.
  const bool by_matrix = image.pixel_from_room.has_value();
  if (by_matrix)
    description.show("source and receptor", "geometry", "projection matrix", "by the profile's projection matrix");
  else
    description.add("SAD", "sad_mm", image.sad_mm, "mm");
  description.add("SID", "sid_mm", image.sid_mm, "mm");
  if (!by_matrix) description.add("gantry angle", "gantry_angle_deg", image.gantry_angle_deg, "deg");
  description.add("couch angle", "couch_angle_deg", image.table.support_angle_deg, "deg");
  description.add("couch pitch", "couch_pitch_deg", image.table.pitch_deg, "deg", taken_as_0("--couch-pitch"));
  description.add("couch roll", "couch_roll_deg", image.table.roll_deg, "deg", taken_as_0("--couch-roll"));
  if (!by_matrix) {
    description.add("receptor translation", "receptor_translation_mm", image.receptor_translation_mm, "mm");
    description.add("receptor angle", "receptor_angle_deg", image.receptor_angle_deg, "deg");
    description.add("pixel spacing", "pixel_spacing_mm", image.pixel_spacing_mm, "mm, rows then columns");
    description.add("RT Image Position", "rt_image_position_mm", image.position_mm, "mm");
    description.add("collimator angle", "collimator_angle_deg", image.collimator_angle_deg, "deg");
  }
  description.show("jaws and leaves", "jaws_and_leaves", described(image.jaws), described(image.jaws));
  if (image.patient_position || !planned_position)
    description.add("patient position", "patient_position", image.patient_position);
  else
    description.show("patient position", "planned_patient_position", *planned_position,
                     *planned_position + ", which its plan says");
  description.add("intensity", "intensity_relationship", image.intensity_relationship);
  description.show("intensity sign", "intensity_sign", image.intensity_sign ? Json(*image.intensity_sign) : Json(),
                   image.intensity_sign ? fmt::format("{:+}", *image.intensity_sign) : "missing");
  description.add("KVP", "kvp", image.kvp, "kV");
  description.add("frame of reference", "frame_of_reference_uid", image.frame_of_reference_uid);
  description.add("isocenter in that frame", "isocenter_mm", image.isocenter_mm, "mm");
  description.add("acquisition date", "acquisition_date", image.acquisition_date);
  description.add("acquisition time", "acquisition_time", image.acquisition_time);
}

Description describe_rt_image(RtImage image, const std::optional<std::string>& planned_position,
                              const std::optional<MachineProfile>& machine) {
  Notes applied;
  if (machine) image = with_machine(image, *machine, {}, applied);
  Description description(image.is_rt_image() ? "RT Image" : "X-ray", image.label, image.path.string());
  add_attributes(image, planned_position, description);
  if (!image.patient_position) image.patient_position = planned_position;
  remark_all(applied.overrides, Remark::kProfile, description);
  if (image.imager && !image.imager->is_corrected)
    description.remark(Remark::kProfile,
                       "the imager's errors are not corrected; they widen the uncertainty of every registration");
  remark_all(image.jaws.problems, Remark::kNote, description);
  remark_all(image.contradictions, Remark::kNote, description);
  for (const MissingAttribute& attribute : missing_attributes(image))
    description.remark(
        Remark::kMissing,
        fmt::format("{}{}; {}", described(attribute.tag), attribute.found.empty() ? "" : " " + attribute.problem(),
                    attribute.supplied_by.empty() ? "no switch supplies it" : "supplied by " + attribute.supplied_by));
  // What stands in the way is told, not thrown: inspecting is for files that registration refuses, too.
  try {
    for (const FailedCheck& finding : rt_image_findings(image))
      description.remark(Remark::kCheck, fmt::format("{}; allowed by --allow {}=REASON", finding.message, finding.key));
    const bool has_geometry = image.pixel_from_room || (image.plane && image.pixel_spacing_mm && image.position_mm &&
                                                        image.sad_mm && image.sid_mm && image.gantry_angle_deg);
    if (has_geometry) add_geometry_as_understood(image, description);
  } catch (const Error& error) {
    description.remark(Remark::kRefused, error.what());
  }
  return description;
}

Description describe_plan(const RtPlan& plan) {
  Description description("RT Plan", plan.label, plan.path.string());
  description.show("approval", "approval_status", plan.approval_status,
                   plan.approval_status.empty() ? "missing" : plan.approval_status);
  description.show("date", "plan_date", plan.made_on, plan.made_on.empty() ? "missing" : plan.made_on);
  description.add("frame of reference", "frame_of_reference_uid", plan.frame_of_reference_uid);
  for (const RtPlan::Beam& beam : plan.beams)
    description.append(fmt::format("beam {} \"{}\"", beam.number, beam.name), "beams",
                       {{"number", beam.number},
                        {"name", beam.name},
                        {"machine", beam.machine},
                        {"isocenter_mm", json_value(beam.isocenter_patient_mm)},
                        {"patient_position", json_value(beam.patient_position)},
                        {"couch_angle_deg", json_value(beam.support_angle_deg)},
                        {"jaws_and_leaves", described(beam.jaws)}},
                       fmt::format("{}isocenter {}, {}, couch {}; jaws and leaves {}",
                                   beam.machine.empty() ? "" : fmt::format("machine \"{}\", ", beam.machine),
                                   or_missing(beam.isocenter_patient_mm, "mm"), or_missing(beam.patient_position),
                                   or_missing(beam.support_angle_deg, "deg"), described(beam.jaws)));
  for (const RtPlan::Beam& beam : plan.beams) remark_all(beam.jaws.problems, Remark::kNote, description);
  return description;
}

Description describe_structures(const std::filesystem::path& path) {
  const RtStructures read = read_rt_structures(path);
  Description description("RT Structure Set", read.label, path.string());
  for (const Structure& structure : read.structures) {
    const std::string ignored = structure.ignored_contours == 0
                                    ? ""
                                    : fmt::format(", {} that {} nothing", structure.ignored_contours,
                                                  structure.ignored_contours == 1 ? "encloses" : "enclose");
    description.append(fmt::format("structure {} \"{}\"", structure.number, structure.name), "structures",
                       {{"number", structure.number},
                        {"name", structure.name},
                        {"interpreted_type", structure.interpreted_type},
                        {"closed_contours", structure.contours.size()},
                        {"ignored_contours", structure.ignored_contours}},
                       fmt::format("{}, {} closed contours{}",
                                   structure.interpreted_type.empty() ? "type missing" : structure.interpreted_type,
                                   structure.contours.size(), ignored));
  }
  return description;
}

Description describe_ct(const StudyFiles::Ct& found, Console& console) {
  const std::string folder = found.files.front().parent_path().string();
  Description description("CT series", "", found.series_instance_uid);
  description.show("files", "files", found.files.size(), fmt::format("{}, from {}", found.files.size(), folder));
  Notes notes;
  try {
    ProgressBar bar(console, "Reading CT");
    const CtSeries ct = read_ct_series(found.files, {{"gaps", "inspection"}}, notes,
                                       [&](std::size_t done, std::size_t total) { bar.update(done, total); });
    const Eigen::Vector3d first = ct.hu.patient_from_voxel.translation();
    const Eigen::Vector3d last = ct.hu.patient_from_voxel * Eigen::Vector3d((ct.hu.size.array() - 1).cast<double>());
    description.show(
        "voxels", "voxels", std::vector<int>(ct.hu.size.begin(), ct.hu.size.end()),
        fmt::format("{}, spacing ({:.4g}) mm", fmt::join(ct.hu.size, " x "), fmt::join(ct.hu.spacing_mm(), ", ")));
    description.show("first voxel, patient", "first_voxel_mm", json_value(first),
                     fmt::format("({:.2f}) mm", fmt::join(first, ", ")));
    description.show("last voxel, patient", "last_voxel_mm", json_value(last),
                     fmt::format("({:.2f}) mm", fmt::join(last, ", ")));
    description.show("frame of reference", "frame_of_reference_uid", ct.frame_of_reference_uid,
                     ct.frame_of_reference_uid);
    description.show("acquisition date", "acquisition_date", ct.acquired_on,
                     ct.acquired_on.empty() ? "missing" : ct.acquired_on);
  } catch (const Error& error) {
    description.remark(Remark::kRefused, error.what());
  }
  remark_all(notes.overrides, Remark::kCheck, description);
  remark_all(notes.warnings, Remark::kNote, description);
  return description;
}

Description describe_registration(const std::filesystem::path& path) {
  const CheckedRegistration checked = check_registration(path);
  Description description("Spatial Registration", "", path.string());
  description.show("takes the frame", "source_frame_uid", checked.source_frame_uid, checked.source_frame_uid);
  description.show("to the frame", "registered_frame_uid", checked.registered_frame_uid, checked.registered_frame_uid);
  if (const auto matrix = rigid_of(checked)) {
    const double angle_deg = deg_from_rad(Eigen::AngleAxisd(matrix->linear()).angle());
    description.add("with its origin at", "origin_mm", std::optional<Eigen::Vector3d>(matrix->translation()), "mm");
    description.add("turned by", "rotation_deg", std::optional(angle_deg), "deg");
  }
  for (const RegistrationFinding& finding : checked.findings)
    description.remark(finding.is_error ? Remark::kCheck : Remark::kNote, finding.text);
  return description;
}

// The bodies of every CT: a picture each, and a table.
void run_inspect_bodies(const std::vector<std::filesystem::path>& paths, const std::filesystem::path& folder,
                        bool overwrite, Console& console) {
  OutputFolder output(folder, overwrite, paths);
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
    for (const auto& file : files.structures) {
      RtStructures structures = read_rt_structures(file.file);
      std::erase_if(structures.structures, [&](const Structure& structure) {
        return structure.frame_of_reference_uid.value_or(ct.frame_of_reference_uid) != ct.frame_of_reference_uid;
      });
      for (DrawnBone& bone : drawn_bones(structures, ct)) drawn.push_back(std::move(bone));
    }
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

// What is said of each file: at once to people, in the end to programs.
class Inspection {
 public:
  Inspection(bool as_json, Console& console) : as_json_(as_json), console_(console) {}

  void tell(const Description& description) {
    if (as_json_)
      files_.push_back(description.json());
    else
      console_.out << printable_lines(description.text()) << "\n";
  }

  // What cannot be read is refused, and the next file is looked at.
  void tell(std::string_view kind, const std::filesystem::path& file,
            const std::function<std::vector<Description>()>& describe) {
    try {
      for (const Description& description : describe()) tell(description);
    } catch (const Error& error) {
      Description description(kind, "", file.string());
      description.remark(Remark::kRefused, error.what());
      tell(description);
      ++unreadable_;
    }
  }

  // And how the X-rays are grouped, so that a person can choose.
  void tell_others(const StudyFiles& files, bool takes_other_xrays) {
    const std::vector<SessionFiles> sessions = sessions_of(files, takes_other_xrays);
    if (as_json_) {
      const Json json = {{"files", files_},
                         {"sessions", json_of(sessions)},
                         {"left_aside", files.left_aside},
                         {"unreadable", files.unreadable}};
      console_.out << json_text(json);
      return;
    }
    std::string text;
    if (sessions.size() > 1) text += fmt::format("{}\n\n", fmt::join(described(sessions), "\n"));
    for (const std::string& file : files.left_aside) text += "left aside: " + file + "\n";
    for (const std::string& reason : files.unreadable) text += "unreadable: " + reason + "\n";
    console_.out << printable_lines(text);
  }

  std::size_t unreadable() const { return unreadable_; }

 private:
  static Json json_of(const std::vector<SessionFiles>& sessions) {
    Json all = Json::array();
    for (const SessionFiles& session : sessions) {
      Json images = Json::array();
      for (const StudyFiles::Image& image : session.images) images.push_back(image.file.string());
      const std::string& acquired = session.images.front().acquired;
      all.push_back({{"name", session.name},
                     {"acquired", acquired.empty() ? Json() : Json(acquired)},
                     {"fraction", json_value(fraction_of(session))},
                     {"images", images}});
    }
    return all;
  }

  bool as_json_;
  Console& console_;
  Json files_ = Json::array();
  std::size_t unreadable_ = 0;
};

std::vector<Description> describe_rt_images(const std::filesystem::path& file,
                                            const std::optional<std::string>& planned_position,
                                            const std::optional<MachineProfile>& machine) {
  Notes notes;
  std::vector<Description> frames;
  for (const RtImage& image : read_rt_images(file, notes))
    frames.push_back(describe_rt_image(image, planned_position, machine));
  for (Description& frame : frames) remark_all(notes.warnings, Remark::kNote, frame);
  return frames;
}

void run_inspect(const std::vector<std::filesystem::path>& paths, const std::optional<MachineProfile>& machine,
                 bool as_json, Console& console) {
  const StudyFiles files = scan_study(paths);
  Inspection inspection(as_json, console);
  std::map<std::string, std::optional<std::string>> planned_positions;  // by the plan's SOPInstanceUID
  for (const StudyFiles::Plan& found : files.plans)
    inspection.tell("RT Plan", found.file, [&]() -> std::vector<Description> {
      const RtPlan plan = read_rt_plan(found.file);
      planned_positions[found.sop_instance_uid] = common_patient_position(plan, plan.beams);
      return {describe_plan(plan)};
    });
  for (const StudyFiles::Ct& ct : files.cts) inspection.tell(describe_ct(ct, console));
  for (const auto& images : {files.images, files.drrs, files.other_xrays})
    for (const StudyFiles::Image& image : images)
      inspection.tell("X-ray", image.file, [&] {
        const auto planned = planned_positions.find(image.plan_uid);
        return describe_rt_images(image.file, planned == planned_positions.end() ? std::nullopt : planned->second,
                                  machine);
      });
  for (const StudyFiles::Structures& structures : files.structures)
    inspection.tell("RT Structure Set", structures.file,
                    [&]() -> std::vector<Description> { return {describe_structures(structures.file)}; });
  for (const std::filesystem::path& registration : files.registrations)
    inspection.tell("Spatial Registration", registration,
                    [&]() -> std::vector<Description> { return {describe_registration(registration)}; });
  inspection.tell_others(files, machine.has_value());
  if (const std::size_t unreadable = inspection.unreadable() + files.unreadable.size(); unreadable > 0)
    throw Error(fmt::format("{} of the files cannot be read; see above", unreadable));
  if (files.cts.empty() && files.images.empty() && files.drrs.empty() && files.other_xrays.empty() &&
      files.plans.empty() && files.structures.empty() && files.registrations.empty())
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
    bool devices = false, overwrite = false, as_json = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand(
      "inspect", "Show what files contain, how their geometry is understood, and every missing attribute");
  command->footer(
      "\nExample:\n  isoshift inspect exported/\n  isoshift inspect RTIMAGE/KV_AP.dcm --json\n"
      "  isoshift inspect exported/ --bodies bodies\n  isoshift inspect --devices");
  auto* paths = command->add_option("path", options->paths, "Files or folders")->type_name("PATH");
  command->add_option("--machine", options->machine, "Machine profile to apply to the X-rays before they are shown")
      ->type_name("FILE");
  command->add_option("--machine-key", options->machine_key, "Public key by which the profile must be signed")
      ->type_name("FILE");
  auto* bodies = command
                     ->add_option("--bodies", options->bodies,
                                  "Find the rigid bodies that the CT shows, draw and list them in this folder")
                     ->type_name("FOLDER");
  auto* json = command->add_flag("--json", options->as_json, "Print JSON instead of text");
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier output in that folder")->needs(bodies);
  auto* devices = command->add_flag("--devices", options->devices, "List the devices that can render");
  command->require_option(1, 0);
  paths->excludes(devices);
  bodies->needs(paths);
  json->needs(paths)->excludes(bodies);
  command->callback([options, &console] {
    if (!options->bodies.empty())
      return run_inspect_bodies(options->paths, options->bodies, options->overwrite, console);
    if (!options->devices)
      return run_inspect(options->paths, named_machine(options->machine, options->machine_key), options->as_json,
                         console);
    run_inspect_devices(console);
  });
}

}  // namespace isoshift
