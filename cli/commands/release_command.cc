// isoshift room release: sends a result that watch holds, and records who released it.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <memory>

#include "base/error.h"
#include "base/system_user.h"
#include "cli/commands/commands.h"
#include "cli/switches/text_on_one_line.h"
#include "io/config/watch_file.h"
#include "io/report/result_folder.h"
#include "workflow/room/deliver.h"
#include "workflow/room/results_tree.h"
#include "workflow/room/session_list.h"

namespace isoshift {
namespace {

void run_release(const std::filesystem::path& file, const std::string& session, const std::string& by,
                 bool despite_other_xrays, Console& console) {
  check_text_on_one_line("--by", by, "the name of the person who releases the session");
  const WatchFile watch = read_watch_file(file);
  check_is_owner(watch.results);
  ResultsTree tree(watch);
  const SystemUser user = system_user();
  const Release release = tree.release(
      session, {.by = by, .user = user.name, .sudo_user = user.sudo_user, .despite_objection = despite_other_xrays},
      watch.names_of_peers());
  const SetupResult result = read_report(tree.session(session));
  console.out << fmt::format("{} ({}), {}\n", result.identity.patient_name, result.identity.patient_id,
                             times_of(result.views));
  console.out << fmt::format("released by {}; the verdict was {}\n", to_string(release.releaser), release.verdict);
  if (!release.despite.empty()) console.err << fmt::format("warning: {}\n", release.despite);
  if (release.is_again)
    console.err << "warning: the session was released before, as the audit log says, and the file of that release is "
                   "gone\n";
  for (const Release::Object& object : release.objects)
    console.out << fmt::format("{} goes to {}\n", object.file,
                               release.peers.empty() ? "nobody: the watch file names no peers"
                                                     : fmt::format("{}", fmt::join(release.peers, ", ")));
  if (release.objects.size() == 1) console.out << "the session holds no registration object\n";
  const auto lock = tree.try_lock();
  if (lock)
    console.err
        << "warning: isoshift room watch is not running: whether other X-rays speak against this result is known only "
           "up to when it last ran\n";
  ConsoleObserver observer(console);
  SystemClock clock;
  DicomSender sender;
  // Without a watch nobody compares what else was released with the source, nor other files with those that are gone.
  const std::filesystem::path missing = tree.missing_input(session);
  if (lock && !missing.empty())
    console.err << fmt::format(
        "warning: {}: is gone: another file may have replaced it. isoshift room watch compares "
        "what is there, and sends then\n",
        missing.string());
  const auto may_be_sent = [&](const std::string& other) { return other == session && missing.empty(); };
  if (lock) Deliverer(watch, sender, clock).deliver(std::stop_token(), may_be_sent, observer);
  if (release.peers.empty()) return;
  if (tree.pending_of(release).empty())
    console.out << "sent\n";
  else if (lock)
    console.out << "not sent yet, and isoshift room watch is not running: once it runs, it tries until every peer has "
                   "confirmed\n";
  else
    console.out << "isoshift room watch sends it, and tries until every peer has confirmed\n";
}

}  // namespace

void add_release_command(CLI::App& app, Console& console, int& exit_status) {
  struct Options {
    std::filesystem::path watch = "/etc/isoshift/watch.json";
    std::string session, by;
    bool despite_other_xrays = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("release", "Release a result that watch holds, and send it to the DICOM peers");
  command->footer(
      "\nExample:\n  isoshift room release 3fa94c1e02b7 --by \"J. Doe\"\n\n"
      "Checks that the result was not changed after the registration, and records who released it, as which\n"
      "user of the system. Then sends report.dcm and, if the result has one, spatial_registration.dcm.\n\n"
      "A result against which other X-rays of the patient speak is refused, unless they are newer and have a\n"
      "result of their own: then a warning says so.");
  command->add_option("session", options->session, "Name of the session, as index.html shows it")
      ->required()
      ->type_name("SESSION");
  command->add_option("--by", options->by, "Name of the person who has looked at the report and releases the result")
      ->required()
      ->type_name("NAME");
  command->add_flag("--despite-other-xrays", options->despite_other_xrays,
                    "Release a result although other X-rays of the patient speak against it, as index.html says");
  command->add_option("--watch", options->watch, "The watch file")->type_name("FILE")->capture_default_str();
  command->callback([options, &console, &exit_status] {
    run_release(options->watch, options->session, options->by, options->despite_other_xrays, console);
    exit_status = kExitAccepted;
  });
}

}  // namespace isoshift
