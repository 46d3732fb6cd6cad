// isoshift deidentify and isoshift bundle: studies and results without what tells who the patient is.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>

#include "base/error.h"
#include "base/output_folder.h"
#include "cli/commands/commands.h"
#include "workflow/deidentify/bundle.h"

namespace isoshift {
namespace {

struct DeidentifyOptions {
  std::vector<std::filesystem::path> study;
  std::filesystem::path output;
  bool overwrite = false;
};

void print_written(const DeidentifiedFiles& written, const std::filesystem::path& folder, Console& console) {
  print_warnings(pixel_warnings(written), console);
  for (const auto& [name, count] : written.count) console.out << fmt::format("{:<9} {:>6} files\n", name, count);
  console.out << fmt::format("Written to {}\n", folder.string());
}

void run_deidentify(const DeidentifyOptions& options, Console& console) {
  ConsoleObserver observer(console);
  const StudyFiles files = scan_study(options.study);
  // A file that looks like DICOM and is missing in the output would be missed by nobody but its reader.
  if (!files.unreadable.empty()) throw Error(fmt::format("{}", fmt::join(files.unreadable, "\n")));
  for (const std::string& file : files.left_aside) observer.say("left aside: " + file);
  OutputFolder output(options.output, options.overwrite, options.study);
  Pseudonyms pseudonyms;
  const DeidentifiedFiles written = deidentify_study(files, output.path(), pseudonyms, observer);
  if (written.count.empty()) throw Error("no CT, X-ray, plan, structure set or registration object is there");
  output.commit();
  print_written(written, output.destination(), console);
}

}  // namespace

void add_deidentify_command(CLI::App& app, Console& console, int&) {
  auto options = std::make_shared<DeidentifyOptions>();
  CLI::App* command = app.add_subcommand(
      "deidentify", "Write a study once more, without what tells who the patient is (PS3.15 Annex E)");
  command->footer("\nExample:\n  isoshift deidentify exported/ -o study");
  command->add_option("study", options->study, "Files or folders")->type_name("STUDY")->required();
  command->add_option("-o,--output", options->output, "Folder to write")->type_name("FOLDER")->required();
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier output in that folder");
  command->callback([options, &console] { run_deidentify(*options, console); });
}

void add_bundle_command(CLI::App& app, Console& console, int&) {
  auto options = std::make_shared<BundleOptions>();
  CLI::App* command =
      app.add_subcommand("bundle", "Gather a result and what was registered, de-identified, for a report of a fault");
  command->footer("\nExample:\n  isoshift bundle out/ exported/ -o bundle");
  command->add_option("result", options->result, "Folder of a result of register")->type_name("RESULT")->required();
  command->add_option("study", options->study, "Files or folders that hold what was registered")
      ->type_name("STUDY")
      ->required();
  command->add_option("-o,--output", options->output, "Folder to write")->type_name("FOLDER")->required();
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier output in that folder");
  command->callback([options, &console] {
    ConsoleObserver observer(console);
    print_written(write_bundle(*options, observer), options->output, console);
  });
}

}  // namespace isoshift
