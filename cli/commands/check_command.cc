// isoshift check: what a Spatial Registration object means, what is wrong with it, and how far two lie apart.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "cli/commands/commands.h"
#include "io/dicom/rt_plan.h"
#include "io/objects/registration_check.h"
#include "io/objects/spatial_registration.h"
#include "setup/couch_shift.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

struct CheckOptions {
  std::vector<std::filesystem::path> registrations;
  std::filesystem::path plan;
  std::vector<double> isocenter, source_isocenter;
  std::string patient_position;
  std::optional<double> couch_angle_deg;
  bool as_json = false;
};

// Where the patient was planned to lie.
struct PlannedSetup {
  std::optional<double> couch_angle_deg;
  TableAngles table;
  Eigen::Vector3d isocenter_patient_mm = Eigen::Vector3d::Zero();
  Eigen::Isometry3d room_from_patient = Eigen::Isometry3d::Identity();
};

// What the switches say, else the plan; nothing where neither says anything.
std::optional<PlannedSetup> planned_setup(const CheckOptions& options) {
  std::optional<Eigen::Vector3d> isocenter;
  std::optional<std::string> position;
  std::optional<double> couch_angle_deg = options.couch_angle_deg;
  if (!options.isocenter.empty()) isocenter = Eigen::Vector3d(options.isocenter.data());
  if (!options.patient_position.empty()) position = options.patient_position;
  if (!options.plan.empty()) {
    const RtPlan plan = read_rt_plan(options.plan);
    if (!isocenter) isocenter = common_isocenter(plan, plan.beams);
    if (!position) position = common_patient_position(plan, plan.beams);
  }
  if (!isocenter && !position) return std::nullopt;
  if ((isocenter && !isocenter->allFinite()) || !std::isfinite(couch_angle_deg.value_or(0.0)))
    throw UsageError("--isocenter and --couch-angle take finite numbers");
  if (!isocenter) throw UsageError("the shift needs the planned isocenter: --plan FILE or --isocenter X,Y,Z");
  if (!position) throw UsageError("the shift needs the patient position: --plan FILE or --patient-position HFS");
  const auto known = patient_position_from(*position);
  if (!known) throw UsageError(fmt::format("the patient position is {}, expected HFS, HFP, FFS, FFP, ...", *position));
  const TableAngles table = {.support_rad = rad_from_deg(couch_angle_deg.value_or(0.0))};
  return PlannedSetup{.couch_angle_deg = couch_angle_deg,
                      .table = table,
                      .isocenter_patient_mm = *isocenter,
                      .room_from_patient = planned_room_from_patient(*known, table, *isocenter)};
}

std::optional<Eigen::Isometry3d> rigid_of(const CheckedRegistration& checked) {
  return checked.registered_from_source ? as_rigid(*checked.registered_from_source) : std::nullopt;
}

bool is_from_room(const CheckedRegistration& checked) { return checked.source_frame_uid == kIecFixedFrameUid; }

// The matrix from a frame that begins at the machine's isocenter; nothing, and a finding, where that is not known.
std::optional<Eigen::Isometry3d> from_isocenter(CheckedRegistration& checked, const CheckOptions& options) {
  std::optional<Eigen::Isometry3d> matrix = rigid_of(checked);
  if (!matrix || !checked.source_is_that_of_images) return matrix;
  if (options.source_isocenter.empty()) {
    checked.findings.push_back(
        {.is_error = false,
         .text =
             "its source frame is that of images, whose origin may lie anywhere: what it means for the couch is known "
             "with --source-isocenter X,Y,Z only, their IsocenterPosition (300A,012C)"});
    return std::nullopt;
  }
  matrix->translate(Eigen::Vector3d(options.source_isocenter.data()));
  return matrix;
}

Json json_of(const CouchShift& shift) {
  return {{"lateral_mm", shift.translation_mm.x()},        {"longitudinal_mm", shift.translation_mm.y()},
          {"vertical_mm", shift.translation_mm.z()},       {"yaw_deg", deg_from_rad(shift.change.z_rad)},
          {"pitch_deg", deg_from_rad(shift.change.x_rad)}, {"roll_deg", deg_from_rad(shift.change.y_rad)}};
}

// The shift that a matrix from the isocenter means; nothing, and a finding, where its origin lies nowhere near the
// planned one.
std::optional<CouchShift> shift_of(CheckedRegistration& checked, const Eigen::Isometry3d& matrix,
                                   const PlannedSetup& setup) {
  constexpr double kMaxSetupErrorMm = 200.0;
  const auto off_isocenter_mm = [&](const Eigen::Isometry3d& pose) {
    return (pose.translation() - setup.isocenter_patient_mm).norm();
  };
  const auto note = [&](bool is_error, std::string text) {
    checked.findings.push_back({.is_error = is_error, .text = std::move(text)});
    return std::nullopt;
  };
  if (off_isocenter_mm(matrix) >= kMaxSetupErrorMm) {
    const bool is_inverted = off_isocenter_mm(matrix.inverse()) < kMaxSetupErrorMm;
    return note(is_inverted,
                fmt::format("its origin lies {:.0f} mm from the planned isocenter: {}", off_isocenter_mm(matrix),
                            is_inverted ? "the matrix looks inverted, as its inverse begins near it"
                                        : "it is not the machine's isocenter, and the shift is not known"));
  }
  if (is_from_room(checked) && !setup.couch_angle_deg)
    return note(false, "it begins in the room's axes: the shift is known with --couch-angle DEG only, as at imaging");
  const Eigen::Isometry3d actual =
      is_from_room(checked) ? matrix.inverse() : actual_room_from_patient(setup.room_from_patient, matrix);
  return couch_shift_for(setup_error_from_poses(setup.room_from_patient, actual), setup.table);
}

// For machines; the same for people is added to `text`.
Json describe(const std::filesystem::path& path, const CheckedRegistration& checked,
              const std::optional<CouchShift>& shift, std::string& text) {
  const char* outcome = checked.has_errors() ? "ERRORS" : "passes";
  text += fmt::format("{}: {}\n", path.string(), outcome);
  Json json = {{"file", path.string()}, {"passes", !checked.has_errors()}, {"findings", Json::array()}};
  for (const RegistrationFinding& finding : checked.findings) {
    const char* kind = finding.is_error ? "error" : "note";
    text += fmt::format("  {:<6} {}\n", kind, finding.text);
    json["findings"].push_back({{"kind", kind}, {"text", finding.text}});
  }
  if (const auto matrix = rigid_of(checked)) {
    const Eigen::Vector3d origin = matrix->translation();
    const double angle_deg = deg_from_rad(Eigen::AngleAxisd(matrix->linear()).angle());
    text += fmt::format("  takes  {}\n  to     {}\n  with   the origin at ({:.3f}) mm, turned by {:.3f} deg\n",
                        checked.source_frame_uid, checked.registered_frame_uid, fmt::join(origin, ", "), angle_deg);
    json["origin_mm"] = {origin.x(), origin.y(), origin.z()};
    json["rotation_deg"] = angle_deg;
  }
  if (shift) {
    text += fmt::format(
        "  means  a couch shift of lateral {:+.2f}, longitudinal {:+.2f}, vertical {:+.2f} mm, yaw {:+.2f}, pitch "
        "{:+.2f}, roll {:+.2f} deg\n",
        shift->translation_mm.x(), shift->translation_mm.y(), shift->translation_mm.z(),
        deg_from_rad(shift->change.z_rad), deg_from_rad(shift->change.x_rad), deg_from_rad(shift->change.y_rad));
    json["couch_shift"] = json_of(*shift);
  }
  return json;
}

struct Checked {
  std::filesystem::path path;
  CheckedRegistration registration;
  std::optional<Eigen::Isometry3d> from_isocenter;
};

// The same for their difference, or why there is none.
Json compare(const Checked& one, const Checked& two, bool& is_inverted, std::string& text) {
  const auto cannot = [&](const char* why) {
    text += fmt::format("difference: none, {}\n", why);
    return Json{{"reason", why}};
  };
  const CheckedRegistration &first = one.registration, &other = two.registration;
  if (!rigid_of(first) || !rigid_of(other)) return cannot("as not both hold one rigid matrix");
  if (first.registered_frame_uid != other.registered_frame_uid)
    return cannot("as they register different frames (CTs)");
  if (is_from_room(first) != is_from_room(other))
    return cannot("as one begins in the room's axes (IEC 61217 Fixed) and the other does not: compare their shifts");
  const auto &a = one.from_isocenter, &b = two.from_isocenter;
  if (!a || !b) return cannot("as the isocenter is not known in the source frame of both (--source-isocenter X,Y,Z)");
  const RegistrationDifference difference = difference_between(*a, *b);
  is_inverted = difference.other_is_inverted;
  text += fmt::format("difference: {:.3f} mm at the isocenter, {:.3f} deg\n", difference.translation_mm,
                      deg_from_rad(difference.angle_rad));
  if (first.source_frame_uid != other.source_frame_uid)
    text += "  their treatment frames differ; both are taken to begin at the machine's isocenter\n";
  if (is_inverted) text += "  error  the second one looks inverted: its inverse lies near the first\n";
  return {{"translation_mm", difference.translation_mm},
          {"rotation_deg", deg_from_rad(difference.angle_rad)},
          {"looks_inverted", is_inverted}};
}

int run_check(const CheckOptions& options, Console& console) {
  const std::optional<PlannedSetup> setup = planned_setup(options);
  std::vector<Checked> all;
  Json json = {{"registrations", Json::array()}};
  std::string text;
  bool has_errors = false;
  for (const std::filesystem::path& path : options.registrations) {
    Checked& checked = all.emplace_back(Checked{.path = path, .registration = check_registration(path)});
    checked.from_isocenter = from_isocenter(checked.registration, options);
    std::optional<CouchShift> shift;
    if (setup && checked.from_isocenter) shift = shift_of(checked.registration, *checked.from_isocenter, *setup);
    json["registrations"].push_back(describe(path, checked.registration, shift, text));
    has_errors = has_errors || checked.registration.has_errors();
  }
  if (all.size() == 2) {
    bool is_inverted = false;
    json["difference"] = compare(all[0], all[1], is_inverted, text);
    has_errors = has_errors || is_inverted;
  }
  console.out << (options.as_json ? json.dump(2) + "\n" : text);
  return has_errors ? kExitFailed : kExitAccepted;
}

}  // namespace

void add_check_command(CLI::App& app, Console& console, int& exit_status) {
  auto options = std::make_shared<CheckOptions>();
  CLI::App* command = app.add_subcommand("check", "Check a Spatial Registration object, or compare two");
  command->footer(
      "\nExample:\n  isoshift check result/spatial_registration.dcm --plan exported/RTPLAN.dcm\n"
      "  isoshift check result/spatial_registration.dcm clinic.dcm\n\n"
      "Works with objects of any program. The exit status is 0 if all is right and 1 if anything is wrong.");
  command->add_option("REGISTRATION", options->registrations, "One or two Spatial Registration objects")
      ->required()
      ->expected(1, 2)
      ->type_name("FILE...");
  command->add_option("--plan", options->plan, "RT Plan: its isocenter and patient position tell the shift")
      ->type_name("FILE");
  command->add_option("--isocenter", options->isocenter, "Planned isocenter in patient coordinates of the CT, mm")
      ->expected(3)
      ->delimiter(',')
      ->type_name("X,Y,Z");
  command->add_option("--patient-position", options->patient_position, "How the patient lies")->type_name("HFS|...");
  command
      ->add_option("--couch-angle", options->couch_angle_deg,
                   "Patient support angle at imaging, IEC 61217; needed for objects from the room's axes")
      ->type_name("DEG");
  command
      ->add_option("--source-isocenter", options->source_isocenter,
                   "Machine's isocenter in the frame of the images that a registration lists, mm")
      ->expected(3)
      ->delimiter(',')
      ->type_name("X,Y,Z");
  command->add_flag("--json", options->as_json, "Print JSON");
  command->callback([options, &console, &exit_status] { exit_status = run_check(*options, console); });
}

}  // namespace isoshift
