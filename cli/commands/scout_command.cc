// isoshift qa scout: a CT against its own scout.

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/output_folder.h"
#include "cli/commands/commands.h"
#include "cli/commands/register_command.h"
#include "cli/switches/rendering_switches.h"
#include "cli/switches/study_switches.h"
#include "workflow/scout/scout_files.h"

namespace isoshift {
namespace {

struct ScoutFlags {
  ScoutRequest request;
  std::vector<std::string> allow;
  std::filesystem::path output;
  bool overwrite = false, as_json = false;
};

int run_scout(ScoutFlags& flags, Console& console) {
  flags.request.allowed = allowances_from(flags.allow);
  std::optional<OutputFolder> folder;  // a folder that cannot be written is refused before the search
  if (!flags.output.empty())
    folder.emplace(flags.output, flags.overwrite, std::vector{flags.request.ct, flags.request.scout});
  ConsoleObserver observer(console);
  const ScoutRegistration found = register_scout(flags.request, observer);
  print_warnings(found.notes.warnings, console);
  if (folder) write_scout_result(found, flags.request, *folder);
  console.out << (flags.as_json ? scout_json(found, flags.request, "", "") : scout_text(found, flags.request));
  if (folder && !flags.as_json)
    console.out << fmt::format("\nWritten to {}\n",
                               std::filesystem::absolute(flags.output).lexically_normal().string());
  return exit_status_of(found.verdict);
}

}  // namespace

void add_scout_command(CLI::App& app, Console& console, int& exit_status) {
  auto flags = std::make_shared<ScoutFlags>();
  ScoutRequest& request = flags->request;
  std::vector<std::string> sides;
  sides.reserve(kTubeSides.size());
  for (const TubeSide side : kTubeSides) sides.emplace_back(to_string(side));
  CLI::App* command = app.add_subcommand(
      "scout", "Register a CT to its own scout, an X-ray at a known pose: the answer should be nothing");
  command->footer(
      "\nExample:\n  isoshift qa scout planning_ct/ scout.dcm -o result\n\n"
      "A scout (topogram, surview) sees two axes of translation and the rotation about its rays.\n"
      "Exit status: 0 accepted, 1 failed, 2 usage, 3 review, 4 rejected.");
  command->add_option("ct", request.ct, "Folder or file of the CT")->required()->type_name("PATH");
  command->add_option("scout", request.scout, "The scout: a CT Image with the image type LOCALIZER")
      ->required()
      ->type_name("FILE");
  command
      ->add_option_function<std::string>(
          "--tube", [flags](const std::string& side) { flags->request.tube = tube_side_from(side); },
          "On which side of the patient the tube stood [the side from which the scout matches better]")
      ->check(CLI::IsMember(sides));
  command->add_option("--sad", request.distances.sad_mm, "Distance Source to Patient, where the file lacks it")
      ->type_name("MM");
  command->add_option("--sid", request.distances.sid_mm, "Distance Source to Detector, where the file lacks it")
      ->type_name("MM");
  add_allow_option(*command, flags->allow);
  command->add_option("--seed", request.seed, "Seed of the search and of the displaced starts")->capture_default_str();
  CLI::Option* output =
      command->add_option("-o,--output", flags->output, "Folder for scout.pdf, scout.png and scout.json")
          ->type_name("FOLDER");
  command->add_flag("--overwrite", flags->overwrite, "Replace an earlier output in that folder")->needs(output);
  command->add_flag("--json", flags->as_json, "Print JSON instead of text");
  add_rendering_options(*command, request.rendering);
  command->callback([flags, &console, &exit_status] { exit_status = run_scout(*flags, console); });
}

}  // namespace isoshift
