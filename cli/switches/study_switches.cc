#include "cli/switches/study_switches.h"

#include <fmt/format.h>

#include "base/pattern.h"

namespace isoshift {
namespace {

std::string allow_keys_help() {
  std::string help = "Allow what a check forbids, with the reason. KEY is one of";
  for (const AllowKey& key : kAllowKeys) help += fmt::format("\n{}: {}", key.key, key.meaning);
  return help;
}

std::string is_date(const std::string& text) {
  static const Pattern date("[0-9]{4}-[0-9]{2}-[0-9]{2}");
  return date.matches(text) ? "" : fmt::format("{} is no date, expected one as 2026-03-01", text);
}

}  // namespace

CLI::Option* add_allow_option(CLI::App& command, std::vector<std::string>& allow) {
  return command.add_option("--allow", allow, allow_keys_help())->type_name("KEY=REASON");
}

CLI::Option* add_source_isocenter_option(CLI::App& command, std::vector<double>& source_isocenter) {
  return command
      .add_option("--source-isocenter", source_isocenter,
                  "Machine's isocenter in the source frame of a Spatial Registration of another program, mm")
      ->expected(3)
      ->delimiter(',')
      ->type_name("X,Y,Z");
}

void add_study_options(CLI::App& command, StudyOptions& options) {
  command
      .add_option("study", options.parts.study, "Folder of the exported study; files are recognized by their contents")
      ->type_name("FOLDER");
  const char* group = "Parts of the study";
  command.add_option("--ct", options.parts.ct, "Folder or files of the planning CT")->type_name("PATH")->group(group);
  command
      .add_option("--image", options.parts.images,
                  "RT Images (X-rays), files or folders; with --machine also X-rays of other SOP classes")
      ->type_name("PATH")
      ->group(group);
  command.add_option("--plan", options.parts.plan, "RT Plan")->type_name("FILE")->group(group);
  command
      .add_option("--structures", options.parts.structures,
                  "RT Structure Set [the one that the plan refers to, or the only one drawn on the CT]")
      ->type_name("FILE")
      ->group(group);
  const char* sessions = "Which session, where the folder holds several (isoshift inspect lists them)";
  SessionChoice& session = options.parts.session;
  command.add_option("--session", session.name, "The session with this name, or one that begins so")
      ->type_name("NAME")
      ->group(sessions);
  command.add_option("--date", session.date, "The session of this day")
      ->check(is_date)
      ->type_name("YYYY-MM-DD")
      ->group(sessions);
  command.add_option("--fraction", session.fraction, "The session of this fraction, as the X-rays number it")
      ->type_name("N")
      ->group(sessions);
  command.add_flag("--latest", session.is_latest, "The last session, or the last of those that fit")->group(sessions);
  for (const char* choice : {"--session", "--date", "--fraction", "--latest"})
    command.get_option(choice)->excludes("--image");
  add_study_switches(command, options);
}

void add_study_switches(CLI::App& command, StudyOptions& options) {
  const char* lacking = "What the files lack (never guessed; each use is written into the result)";
  command.add_option("--isocenter", options.isocenter, "Planned isocenter in patient coordinates of the CT, mm")
      ->delimiter(',')
      ->expected(3)
      ->type_name("X,Y,Z")
      ->group(lacking);
  command.add_option("--patient-position", options.patient_position, "How the patient lies on the table")
      ->check(CLI::IsMember({"HFS", "HFP", "FFS", "FFP", "HFDR", "HFDL", "FFDR", "FFDL"}))
      ->group(lacking);
  command.add_option("--couch-angle", options.couch_angle_deg, "Patient support angle at imaging, IEC 61217")
      ->type_name("DEG")
      ->group(lacking);
  command
      .add_option("--couch-pitch", options.couch_pitch_deg,
                  "Table top pitch angle at imaging, IEC 61217: positive with the gantry end up")
      ->type_name("DEG")
      ->group(lacking);
  command
      .add_option(
          "--couch-roll", options.couch_roll_deg,
          "Table top roll angle at imaging, IEC 61217: positive with the right side down, seen facing the gantry")
      ->type_name("DEG")
      ->group(lacking);
  command.add_option("--gantry-angle", options.gantry_angles, "Gantry angle of the image with this label, IEC 61217")
      ->type_name("LABEL=DEG")
      ->group(lacking);
  command.add_option("--sad", options.sad_mm, "Source to axis distance")->type_name("MM")->group(lacking);
  command.add_option("--sid", options.sid_mm, "Source to image plane distance")->type_name("MM")->group(lacking);
  command.add_option("--rt-image-position", options.rt_image_position, "Center of the first pixel on the receptor, mm")
      ->delimiter(',')
      ->expected(2)
      ->type_name("X,Y")
      ->group(lacking);
  command
      .add_flag("--assume-centered", options.assume_centered,
                "Take images without RT Image Position as centered on the central ray")
      ->group(lacking);
  command
      .add_option("--intensity", options.intensity,
                  "Pixel Intensity Relationship and its sign; with +, a higher stored value means more X-ray intensity")
      ->check(CLI::IsMember({"LIN+", "LIN-", "LOG+", "LOG-"}))
      ->group(lacking);
  command.add_option("--beam", options.beam, "Beam quality of all images")
      ->check(CLI::IsMember({"kv", "mv"}))
      ->group(lacking);
  command
      .add_option("--machine", options.machine,
                  "Machine profile: what a machine's files lack or say wrongly (docs/machine-profile.md)")
      ->type_name("FILE")
      ->group(lacking);
  command
      .add_option("--machine-key", options.machine_key,
                  "Public key by which FILE.sig beside the machine profile must be signed (a profile that corrects an "
                  "imager needs it)")
      ->type_name("FILE")
      ->group(lacking);
  add_allow_option(command, options.allow)->group(lacking);
}

}  // namespace isoshift
