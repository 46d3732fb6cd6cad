// isoshift report: all formats of a stored result, made again.

#include <fmt/format.h>

#include <memory>

#include "base/error.h"
#include "base/output_folder.h"
#include "cli/commands/commands.h"
#include "cli/commands/register_command.h"
#include "cli/switches/study_switches.h"
#include "io/report/formats.h"
#include "io/report/result_folder.h"
#include "workflow/register/setup_result_of.h"

namespace isoshift {
namespace {

struct ReportOptions {
  std::filesystem::path result, output, site, registration;
  std::string anatomy;
  std::vector<double> source_isocenter;  // of the registration object
  bool overwrite = false;
};

// A report cannot answer for another target than its registration did.
void check_target_is_the_sites(const SetupResult& report, const ReportOptions& options) {
  if (options.site.empty() || !report.target) return;
  const std::string& of_site = report.site->target;
  if (!of_site.empty() && of_site != report.target->name && of_site != "isocenter")
    throw Error(
        fmt::format("{}: is the result for {}, and the target of {} is {}. Register the study again with this site "
                    "file, or report without it",
                    (options.result / kResultFile).string(), report.target->name, options.site.string(), of_site));
}

void run_report(const ReportOptions& options, Console& console) {
  SetupResult report = read_result(options.result);
  report.site = chosen_site(named_site(options.site), options.anatomy, report.site);
  check_target_is_the_sites(report, options);
  // A result may be replaced by its own report, but by nothing that takes the place of a folder around it.
  const std::filesystem::path place = options.output.empty() ? options.result : options.output;
  std::vector<std::filesystem::path> inputs = {options.site};
  if (std::error_code none; !std::filesystem::equivalent(place, options.result, none)) inputs.push_back(options.result);
  OutputFolder output(place, options.overwrite, inputs);
  write_result(report, output.path());
  if (options.site.empty())  // nothing in it has changed
    std::filesystem::copy_file(options.result / kResultFile, output.path() / kResultFile,
                               std::filesystem::copy_options::overwrite_existing);
  if (const auto registration = options.result / kRegistrationFile; std::filesystem::exists(registration))
    std::filesystem::copy_file(registration, output.path() / kRegistrationFile);
  output.commit();
  console.out << text_report(report_page(report)) << fmt::format("\nWritten to {}\n", output.destination().string());
}

// A registration object over the X-rays of a study: the pose is judged and searched no further.
int run_report_of_object(const ReportOptions& options, Console& console) {
  if (options.output.empty()) throw UsageError("a report of a registration object needs a folder: -o FOLDER");
  RegisterOptions request;
  request.study.parts.study = options.result;
  request.start = options.registration;
  request.source_isocenter = options.source_isocenter;
  request.registration.search.is_searched = false;
  request.site = options.site;
  request.anatomy = options.anatomy;
  request.output = options.output;
  request.overwrite = options.overwrite;
  return run_register(request, false, console);
}

}  // namespace

void add_report_command(CLI::App& app, Console& console, int& exit_status) {
  auto options = std::make_shared<ReportOptions>();
  CLI::App* command = app.add_subcommand(
      "report",
      "Write the report of a stored result again, or of a registration object of any program, in all formats");
  command->footer(
      "\nExample:\n  isoshift report result/ --overwrite\n  isoshift report result/ --site linac3.json -o "
      "result_linac3\n"
      "  isoshift report exported/ --reg theirs.dcm -o compared\n\n"
      "Reads result.json and the pictures, and writes what register writes. Nothing is registered again.\n"
      "With --reg the folder is that of a study, and the report shows the object's pose over the X-rays: what "
      "register\n"
      "--start FILE --no-search writes, which takes all flags of a study.");
  command->add_option("result", options->result, "Folder of a result, with --reg that of a study")
      ->required()
      ->type_name("FOLDER");
  auto* registration = command
                           ->add_option("--reg", options->registration,
                                        "Registration object of any program, whose pose is shown over the X-rays")
                           ->type_name("FILE");
  add_source_isocenter_option(*command, options->source_isocenter)->needs(registration);
  command->add_option("-o,--output", options->output, "Folder to write to [the folder of the result]")
      ->type_name("FOLDER");
  command->add_option("--site", options->site, "Site file to apply [the one that was applied before]")
      ->type_name("FILE");
  command
      ->add_option("--anatomy", options->anatomy,
                   "Anatomy of the site file whose action level applies [the one that was applied before]")
      ->type_name("NAME");
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier output in that folder");
  command->callback([options, &console, &exit_status] {
    if (options->registration.empty())
      run_report(*options, console);
    else
      exit_status = run_report_of_object(*options, console);
  });
}

}  // namespace isoshift
