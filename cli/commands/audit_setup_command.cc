// isoshift qa audit-setup: all sessions of an archive against the couch shifts that the clinic used.

#include <fmt/format.h>

#include <memory>

#include "base/error.h"
#include "base/local_time.h"
#include "cli/commands/commands.h"
#include "cli/switches/study_switches.h"
#include "workflow/audit_setup/archive.h"
#include "workflow/audit_setup/audit_files.h"
#include "workflow/audit_setup/audit_words.h"
#include "workflow/audit_setup/used_shifts.h"
#include "workflow/register/study_options.h"

namespace isoshift {
namespace {

struct AuditSetupOptions {
  std::filesystem::path archive, used, output;
  std::vector<double> source_isocenter;
  bool overwrite = false, as_json = false;
};

SetupAudit audit_archive(const AuditSetupOptions& options) {
  check_finite("--source-isocenter", options.source_isocenter);
  const bool are_objects = std::filesystem::is_directory(options.used);
  if (!options.source_isocenter.empty() && !are_objects)
    throw UsageError("--source-isocenter is used only for registration objects: --used FOLDER");
  std::vector<AuditedSession> sessions =
      read_archive(options.archive, are_objects ? ComparedShift::kFull : ComparedShift::kOfSitesCouch);
  std::vector<std::string> of_no_use;
  std::string used_sha256;
  if (are_objects) {
    std::optional<Eigen::Vector3d> source_isocenter_mm;
    if (!options.source_isocenter.empty()) source_isocenter_mm = Eigen::Vector3d(options.source_isocenter.data());
    of_no_use = read_used_objects(options.used, source_isocenter_mm, sessions);
  } else if (!options.used.empty()) {
    used_sha256 = read_used_table(options.used, sessions);
  }
  SetupAudit audit = audit_of(std::move(sessions));
  audit.made_on = local_time();
  audit.used_sha256 = std::move(used_sha256);
  audit.of_no_use = std::move(of_no_use);
  return audit;
}

}  // namespace

void add_audit_setup_command(CLI::App& app, Console& console, int& exit_status) {
  auto options = std::make_shared<AuditSetupOptions>();
  CLI::App* command = app.add_subcommand(
      "audit-setup", "Compare all sessions of an archive with the couch shifts that the clinic used");
  command->footer(fmt::format(
      "\nExample:\n  isoshift qa audit-setup results/ --used shifts.csv -o audit\n"
      "  isoshift qa audit-setup results/ --used exported_registrations/ -o audit\n\n"
      "Finds all results of register, batch and watch below the folder. Shows how well the used shifts agree with\n"
      "what isoshift found, drifts, systematic and random errors with margins, and sessions that stand out.\n"
      "The first line of a table is {}:\n"
      "the couch shift that was applied, along and about the table top's axes (IEC 61217); a session is named as the\n"
      "folder of its result. (isoshift room audit is something else: it checks the audit log of watch.)\n\n"
      "Exit status: 0 the audit was made, whatever it found; 1 failed, 2 usage.",
      used_shifts_header()));
  command->add_option("archive", options->archive, "Folder that holds results")->required()->type_name("FOLDER");
  command
      ->add_option("--used", options->used,
                   "The couch shifts that the clinic used: a table (CSV), or a folder of Spatial Registration objects; "
                   "without it only what isoshift found is described")
      ->check(CLI::ExistingPath)
      ->type_name("PATH");
  add_source_isocenter_option(*command, options->source_isocenter);
  CLI::Option* output =
      command->add_option("-o,--output", options->output, "Folder for audit.html, audit.csv and audit.json")
          ->type_name("FOLDER");
  command->add_flag("--overwrite", options->overwrite, "Replace an earlier output in that folder")->needs(output);
  command->add_flag("--json", options->as_json, "Print JSON instead of text");
  command->callback([options, &console, &exit_status] {
    const SetupAudit audit = audit_archive(*options);
    print_warnings(audit.of_no_use, console);
    if (!options->output.empty()) write_audit(audit, options->used, options->output, options->overwrite);
    console.out << (options->as_json ? audit_json(audit) : audit_text(audit));
    exit_status = kExitAccepted;
  });
}

}  // namespace isoshift
