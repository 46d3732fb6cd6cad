// isoshift check: what a Spatial Registration object means, what is wrong with it, and how far two lie apart.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_file.h"
#include "base/output_folder.h"
#include "cli/commands/commands.h"
#include "cli/switches/study_switches.h"
#include "io/dicom/rt_plan.h"
#include "io/objects/itk_transform.h"
#include "io/objects/registration_check.h"
#include "io/objects/registration_meaning.h"
#include "io/objects/spatial_registration.h"
#include "setup/couch_shift.h"
#include "workflow/register/study_options.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

struct CheckOptions {
  std::vector<std::filesystem::path> registrations;
  std::filesystem::path plan;
  std::vector<double> isocenter, source_isocenter, about;
  std::filesystem::path transform;
  std::string patient_position;
  std::optional<double> couch_angle_deg, couch_pitch_deg, couch_roll_deg;
  bool as_json = false;

  void check() const;
};

void CheckOptions::check() const {
  check_finite("--isocenter", isocenter);
  check_finite("--source-isocenter", source_isocenter);
  check_finite("--about", about);
  const bool asks_for_shift = !plan.empty() || !isocenter.empty() || !patient_position.empty();
  for (const auto& [flag, angle_deg] :
       {std::pair("--couch-angle", couch_angle_deg), std::pair("--couch-pitch", couch_pitch_deg),
        std::pair("--couch-roll", couch_roll_deg)})
    if (angle_deg && !asks_for_shift)
      throw UsageError(
          fmt::format("{} is used only for a couch shift: add --plan FILE, or --isocenter X,Y,Z and "
                      "--patient-position HFS",
                      flag));
  if (!about.empty() && !asks_for_shift)
    throw UsageError(
        "--about is used only for a couch shift: add --plan FILE, or --isocenter X,Y,Z and --patient-position HFS");
  if (!transform.empty() && registrations.size() > 1)
    throw UsageError("--tfm writes the matrix of one object: name one");
  check_couch_angles(couch_angle_deg, couch_pitch_deg, couch_roll_deg);
}

void write_transform(const CheckedRegistration& checked, const std::filesystem::path& path) {
  const auto matrix = rigid_of(checked);
  if (!matrix)
    throw Error(fmt::format("{}: holds no rigid matrix from one frame to another, so that none is written",
                            checked.path.string()));
  if (checked.source_frame_uid == kIecFixedFrameUid)
    throw Error(
        fmt::format("{}: takes the axes of the room to the CT, and such a file is in those of the patient (LPS)",
                    checked.path.string()));
  write_text(path, itk_transform(*matrix));
}

// Of a plan with several isocenters --isocenter names one.
void check_is_planned(const Eigen::Vector3d& isocenter_mm, const RtPlan& plan) {
  constexpr double kSamePlaceMm = 0.01;
  const RtPlan::Beam* other = nullptr;
  for (const RtPlan::Beam& beam : plan.beams) {
    if (!beam.isocenter_patient_mm) continue;
    if ((*beam.isocenter_patient_mm - isocenter_mm).norm() <= kSamePlaceMm) return;
    other = &beam;
  }
  if (other != nullptr)
    throw UsageError(fmt::format("--isocenter ({:.3f}) contradicts the plan, whose isocenter is ({:.3f}): give one",
                                 fmt::join(isocenter_mm, ", "), fmt::join(*other->isocenter_patient_mm, ", ")));
}

// What the switches say, else the plan; nothing where neither says anything.
std::optional<PlannedSetup> planned_setup(const CheckOptions& options) {
  PlannedSetup setup = {.couch_angle_deg = options.couch_angle_deg,
                        .couch_pitch_deg = options.couch_pitch_deg,
                        .couch_roll_deg = options.couch_roll_deg};
  std::optional<Eigen::Vector3d> isocenter;
  std::optional<std::string> position;
  if (!options.isocenter.empty()) isocenter = Eigen::Vector3d(options.isocenter.data());
  if (!options.patient_position.empty()) position = options.patient_position;
  if (!options.plan.empty()) {
    setup.plan = read_rt_plan(options.plan);
    const auto planned_position = common_patient_position(*setup.plan, setup.plan->beams);
    if (!isocenter) isocenter = common_isocenter(*setup.plan, setup.plan->beams);
    check_is_planned(*isocenter, *setup.plan);
    if (position && planned_position && *position != *planned_position)
      throw UsageError(fmt::format("--patient-position {} contradicts the plan, which says {}: give one", *position,
                                   *planned_position));
    if (!position) position = planned_position;
  }
  if (!isocenter && !position) return std::nullopt;
  if (!isocenter) throw UsageError("the shift needs the planned isocenter: --plan FILE or --isocenter X,Y,Z");
  if (!position) throw UsageError("the shift needs the patient position: --plan FILE or --patient-position HFS");
  const auto known = patient_position_from(*position);
  if (!known) throw UsageError(fmt::format("the patient position is {}, expected HFS, HFP, FFS, FFP, ...", *position));
  setup.isocenter_patient_mm = *isocenter;
  setup.patient_position = *known;
  return setup;
}

Json json_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

Json json_of(const CouchShift& shift) {
  return {{"lateral_mm", shift.translation_mm.x()},        {"longitudinal_mm", shift.translation_mm.y()},
          {"vertical_mm", shift.translation_mm.z()},       {"yaw_deg", deg_from_rad(shift.change.z_rad)},
          {"pitch_deg", deg_from_rad(shift.change.x_rad)}, {"roll_deg", deg_from_rad(shift.change.y_rad)}};
}

// How the couch stood at imaging, as far as anybody said: an angle of null does not enter or was taken as 0.
Json json_of_couch(const PlannedSetup& setup) {
  const auto angle = [](const std::optional<double>& deg) { return deg ? Json(*deg) : Json(); };
  return {{"angle_deg", angle(setup.couch_angle_deg)},
          {"pitch_deg", setup.couch_pitch_deg.value_or(0.0)},
          {"pitch_taken_as_0", !setup.couch_pitch_deg},
          {"roll_deg", setup.couch_roll_deg.value_or(0.0)},
          {"roll_taken_as_0", !setup.couch_roll_deg}};
}

// The shift of a couch, or of a system, that turns about another point of the planned patient than the isocenter.
Json describe_about(const Eigen::Vector3d& point_patient_mm, const Eigen::Isometry3d& setup_error,
                    const PlannedSetup& setup, std::string& text) {
  const Eigen::Vector3d point_mm = setup.room_from_patient() * point_patient_mm;
  const Eigen::Vector3d shift_mm = couch_shift_for(setup_error, setup.table(), point_mm).translation_mm;
  text += fmt::format(
      "  about  ({:.3f}) mm of the registered frame instead of the isocenter: lateral {:+.2f}, longitudinal {:+.2f}, "
      "vertical {:+.2f} mm, and the same angles\n",
      fmt::join(point_patient_mm, ", "), shift_mm.x(), shift_mm.y(), shift_mm.z());
  return {{"point_mm", json_of(point_patient_mm)},
          {"lateral_mm", shift_mm.x()},
          {"longitudinal_mm", shift_mm.y()},
          {"vertical_mm", shift_mm.z()}};
}

// For machines; the same for people is added to `text`. `about_mm`: a point of the registered frame, or nothing.
Json describe(const CheckedRegistration& checked, const RegistrationMeaning& meaning,
              const std::optional<PlannedSetup>& setup, const std::optional<Eigen::Vector3d>& about_mm,
              std::string& text) {
  const char* outcome = checked.has_errors() ? "ERRORS" : "passes";
  text += fmt::format("{}: {}\n", checked.path.string(), outcome);
  Json json = {{"file", checked.path.string()}, {"passes", !checked.has_errors()}, {"findings", Json::array()}};
  for (const RegistrationFinding& finding : checked.findings) {
    const char* kind = finding.is_error ? "error" : "note";
    text += fmt::format("  {:<6} {}\n", kind, finding.text);
    json["findings"].push_back({{"kind", kind}, {"text", finding.text}});
  }
  if (const auto matrix = rigid_of(checked)) {
    const double angle_deg = deg_from_rad(Eigen::AngleAxisd(matrix->linear()).angle());
    text += fmt::format("  takes  {}\n  to     {}\n  with   the origin at ({:.3f}) mm, turned by {:.3f} deg\n",
                        checked.source_frame_uid, checked.registered_frame_uid, fmt::join(matrix->translation(), ", "),
                        angle_deg);
    json["origin_mm"] = json_of(matrix->translation());
    json["rotation_deg"] = angle_deg;
    json["source_isocenter_mm"] = meaning.source_isocenter_mm ? json_of(*meaning.source_isocenter_mm) : Json();
  }
  if (meaning.registered_from_isocenter) {
    const Eigen::Vector3d isocenter_mm = meaning.registered_from_isocenter->translation();
    text += fmt::format("  has    the machine's isocenter at ({:.3f}) mm of the registered frame\n",
                        fmt::join(isocenter_mm, ", "));
    json["machine_isocenter_mm"] = json_of(isocenter_mm);
  }
  if (setup) json["couch_shift"] = meaning.couch_shift ? json_of(*meaning.couch_shift) : Json();
  if (const auto& shift = meaning.couch_shift) {
    text += fmt::format(
        "  means  a couch shift of lateral {:+.2f}, longitudinal {:+.2f}, vertical {:+.2f} mm, yaw {:+.2f}, pitch "
        "{:+.2f}, roll {:+.2f} deg\n",
        shift->translation_mm.x(), shift->translation_mm.y(), shift->translation_mm.z(),
        deg_from_rad(shift->change.z_rad), deg_from_rad(shift->change.x_rad), deg_from_rad(shift->change.y_rad));
    const Eigen::Vector3d turned_first_mm = translation_after_rotation_mm(*meaning.setup_error, setup->table());
    text += fmt::format(
        "         which translates first. A console whose couch turns about the isocenter first shows lateral {:+.2f}, "
        "longitudinal {:+.2f}, vertical {:+.2f} mm\n",
        turned_first_mm.x(), turned_first_mm.y(), turned_first_mm.z());
    json["couch_shift_turned_first"] = {{"lateral_mm", turned_first_mm.x()},
                                        {"longitudinal_mm", turned_first_mm.y()},
                                        {"vertical_mm", turned_first_mm.z()}};
    json["couch_at_imaging"] = json_of_couch(*setup);
    if (about_mm) json["couch_shift_about"] = describe_about(*about_mm, *meaning.setup_error, *setup, text);
  }
  return json;
}

// For machines; the same for people is added to `text`.
Json describe(const RegistrationComparison& comparison, bool same_source_frame, std::string& text) {
  if (!comparison.difference) {
    text += fmt::format("difference: not known\n  error  {}\n", comparison.why_not);
    return {{"translation_mm", nullptr}, {"rotation_deg", nullptr}, {"reason", comparison.why_not}};
  }
  const RegistrationDifference& difference = *comparison.difference;
  text += fmt::format("difference: {:.3f} mm at the isocenter, {:.3f} deg\n", difference.translation_mm,
                      deg_from_rad(difference.angle_rad));
  if (!same_source_frame)
    text +=
        "  note   the objects have different source frames: for the comparison, the origin of each was moved to the "
        "machine's isocenter\n";
  if (!comparison.has_patient_ids)
    text +=
        "  note   a PatientID (0010,0020) is empty: only their common frame of reference says that both are of one "
        "patient\n";
  if (difference.other_is_inverted)
    text += "  error  the second object looks inverted: its inverse lies near the first object\n";
  return {{"translation_mm", difference.translation_mm},
          {"rotation_deg", deg_from_rad(difference.angle_rad)},
          {"looks_inverted", difference.other_is_inverted},
          {"patient_ids_compared", comparison.has_patient_ids}};
}

int run_check(const CheckOptions& options, Console& console) {
  options.check();
  const std::optional<PlannedSetup> setup = planned_setup(options);
  std::vector<CheckedRegistration> all;
  all.reserve(options.registrations.size());
  for (const std::filesystem::path& path : options.registrations) all.push_back(check_registration(path));
  std::optional<Eigen::Vector3d> source_isocenter_mm;
  if (!options.source_isocenter.empty()) {
    source_isocenter_mm = Eigen::Vector3d(options.source_isocenter.data());
    refuse_contradicting_isocenter(all, *source_isocenter_mm);
  }
  std::optional<Eigen::Vector3d> about_mm;
  if (!options.about.empty()) about_mm = Eigen::Vector3d(options.about.data());
  std::vector<RegistrationMeaning> meanings;
  Json json = {{"registrations", Json::array()}};
  std::string text;
  bool has_errors = false;
  for (CheckedRegistration& checked : all) {
    meanings.push_back(meaning_of(checked, setup, source_isocenter_mm));
    json["registrations"].push_back(describe(checked, meanings.back(), setup, about_mm, text));
    has_errors = has_errors || checked.has_errors();
  }
  if (all.size() == 2) {
    const RegistrationComparison comparison = compare(all[0], meanings[0], all[1], meanings[1]);
    json["difference"] = describe(comparison, all[0].source_frame_uid == all[1].source_frame_uid, text);
    has_errors = has_errors || !comparison.difference || comparison.difference->other_is_inverted;
  }
  console.out << (options.as_json ? json_text(json) : text);
  if (!options.transform.empty()) write_transform(all.front(), options.transform);
  return has_errors ? kExitFailed : kExitAccepted;
}

}  // namespace

void add_check_command(CLI::App& app, Console& console, int& exit_status) {
  auto options = std::make_shared<CheckOptions>();
  CLI::App* command = app.add_subcommand("check", "Check a Spatial Registration object, or compare two");
  command->footer(
      "\nExample:\n  isoshift check result/spatial_registration.dcm --plan exported/RTPLAN.dcm\n"
      "  isoshift check result/spatial_registration.dcm clinic.dcm --source-isocenter 0,0,0\n"
      "  isoshift check from_room.dcm --plan RTPLAN.dcm --couch-angle 10 --couch-pitch 1.5 --couch-roll -0.5\n\n"
      "Works with objects of any program. The exit status is 0 if no error was found. It is 1 if an error was found,\n"
      "or if the couch shift or the difference was asked for and cannot be determined.");
  command->add_option("REGISTRATION", options->registrations, "One or two Spatial Registration objects")
      ->required()
      ->expected(1, 2)
      ->type_name("FILE...");
  command->add_option("--plan", options->plan, "RT Plan, whose isocenter and patient position the couch shift needs")
      ->type_name("FILE");
  command->add_option("--isocenter", options->isocenter, "Planned isocenter in patient coordinates of the CT, mm")
      ->expected(3)
      ->delimiter(',')
      ->type_name("X,Y,Z");
  command->add_option("--patient-position", options->patient_position, "How the patient lies")->type_name("HFS|...");
  command
      ->add_option(
          "--couch-angle", options->couch_angle_deg,
          "Patient support angle at imaging, IEC 61217, plus the table top eccentric angle; needed for objects "
          "from the room's axes")
      ->type_name("DEG");
  command
      ->add_option(
          "--couch-pitch", options->couch_pitch_deg,
          "Table top pitch angle at imaging, IEC 61217; without this flag the angle is taken as 0, with a note")
      ->type_name("DEG");
  command
      ->add_option("--couch-roll", options->couch_roll_deg,
                   "Table top roll angle at imaging, IEC 61217; without this flag the angle is taken as 0, with a note")
      ->type_name("DEG");
  add_source_isocenter_option(*command, options->source_isocenter);
  command
      ->add_option("--tfm", options->transform,
                   "Also write the matrix in ITK's format, for ITK, 3D Slicer and plastimatch; the file must not exist")
      ->type_name("FILE");
  command
      ->add_option("--about", options->about,
                   "Also print the couch shift of a system that turns about this point of the registered frame, mm")
      ->expected(3)
      ->delimiter(',')
      ->type_name("X,Y,Z");
  command->add_flag("--json", options->as_json, "Print JSON");
  command->callback([options, &console, &exit_status] { exit_status = run_check(*options, console); });
}

}  // namespace isoshift
