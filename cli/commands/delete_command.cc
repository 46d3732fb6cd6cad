// isoshift room delete: deletes the results of a session, or of a patient, that watch has kept.

#include <fmt/format.h>

#include <memory>
#include <set>

#include "base/error.h"
#include "cli/commands/commands.h"
#include "cli/switches/text_on_one_line.h"
#include "io/config/watch_file.h"
#include "io/report/result_folder.h"
#include "workflow/room/results_tree.h"

namespace isoshift {
namespace {

struct DeleteOptions {
  std::filesystem::path watch = "/etc/isoshift/watch.json";
  std::string session, patient, by;
};

// Whom a person means: an ID of any issuer, or one of an issuer.
bool is_of(const Identity& identity, const std::string& patient) {
  return identity.patient_id == patient ||
         (!identity.patient_id_issuer.empty() && patient_in_words(identity) == patient);
}

// The first sessions of all X-rays of a patient. A result that cannot be read may be of that patient: it is said.
// Throws Error if the name is that of two patients: an ID may read like that of another with its issuer.
std::set<std::string> sessions_of_patient(const ResultsTree& tree, const std::string& patient, Console& console) {
  std::set<std::string> found, ids;
  for (const std::string& session : tree.sessions()) {
    try {
      const Identity identity = read_report(tree.session(session)).identity;
      if (!is_of(identity, patient)) continue;
      found.insert(name_of_xrays(session));
      ids.insert(identity.patient_id);
    } catch (const Error& error) {
      console.err << fmt::format("warning: session {} is not deleted, and may be of this patient: {}\n", session,
                                 error.what());
    }
  }
  if (ids.size() > 1)
    throw Error(
        fmt::format("--patient {}: is the ID of one patient, and that of another with its issuer. Delete sessions by "
                    "their names",
                    patient));
  for (const auto& [session, version] : tree.chosen()) {
    try {
      const auto choice = tree.choice(session);
      if (choice && (choice->patient_id == patient || patient.starts_with(choice->patient_id + " (")))
        found.insert(session);
    } catch (const Error& error) {
      console.err << fmt::format("warning: a choice is not deleted, and may be of this patient: {}\n", error.what());
    }
  }
  return found;
}

void run_delete(const DeleteOptions& options, Console& console) {
  check_text_on_one_line("--by", options.by, "the name of the person who deletes the results");
  const WatchFile watch = read_watch_file(options.watch);
  check_is_owner(watch.results);
  ResultsTree tree(watch);
  std::set<std::string> sessions{options.session};
  if (!options.patient.empty()) {
    sessions = sessions_of_patient(tree, options.patient, console);
    if (sessions.empty())
      throw Error(fmt::format("{}: holds no result of patient {}", watch.results.string(), options.patient));
  }
  for (const std::string& session : sessions) {
    tree.remove(session, options.by);
    console.out << fmt::format("session {}: deleted\n", session);
  }
  if (tree.try_lock())
    console.err
        << "warning: isoshift room watch is not running: until it runs, its index.html and the pages of months still "
           "name the patient\n";
  console.out
      << "The source still holds the X-rays, CT and plan; isoshift room watch does not register the X-rays again.\n";
}

}  // namespace

void add_delete_command(CLI::App& app, Console& console, int& exit_status) {
  auto options = std::make_shared<DeleteOptions>();
  CLI::App* command = app.add_subcommand("delete", "Delete results that watch has kept, and record that");
  command->footer(
      "\nExamples:\n  isoshift room delete 3fa94c1e02b7 --by \"J. Doe\"\n"
      "  isoshift room delete --patient 1234567 --by \"J. Doe\"\n\n"
      "Deletes all results of the session's X-rays, with records, releases, decisions and marks of what was sent.\n"
      "The audit log, which names no patient, keeps its lines and has one more. What is released and still to be\n"
      "sent is not deleted. X-rays, CT and plan in the source are not touched, and not registered again.");
  CLI::Option* session = command->add_option("session", options->session, "Name of the session, as index.html shows it")
                             ->type_name("SESSION");
  CLI::Option* patient =
      command
          ->add_option("--patient", options->patient,
                       "PatientID instead of a session, for all of the patient's results: 1234567 of any issuer, "
                       "\"1234567 (ISSUER)\" of one")
          ->type_name("ID");
  session->excludes(patient);
  command->add_option("--by", options->by, "Name of the person who deletes the results")->required()->type_name("NAME");
  command->add_option("--watch", options->watch, "The watch file")->type_name("FILE")->capture_default_str();
  command->callback([options, &console, &exit_status] {
    if (options->session.empty() && options->patient.empty())
      throw UsageError("SESSION or --patient: expected one of them: whose results are to be deleted");
    run_delete(*options, console);
    exit_status = kExitAccepted;
  });
}

}  // namespace isoshift
