// isoshift room watch: registers what comes into a treatment room, and holds the results until they are released.

#include <fmt/format.h>

#include <memory>

#include "base/error.h"
#include "base/graceful_end.h"
#include "cli/commands/commands.h"
#include "cli/commands/register_command.h"
#include "io/config/watch_file.h"
#include "workflow/register/setup_result_of.h"
#include "workflow/room/child_runner.h"
#include "workflow/room/folder_source.h"
#include "workflow/room/orthanc_source.h"
#include "workflow/room/watch.h"

namespace isoshift {
namespace {

// The flags in a watch file must be flags of isoshift register, without those that watch itself sets.
RegisterOptions checked_registration_flags(const WatchFile& watch) {
  try {
    RegisterOptions options = register_options_from(watch.registration);
    options.study.parts.study = watch.results;  // any folder will do: only the flags are checked
    (void)options.study.request();
    if (!options.site.empty())
      throw UsageError("--site does not belong here: the key site of the watch file names the site file");
    (void)chosen_site(watch.site, options.anatomy);
    return options;
  } catch (const UsageError& error) {
    throw Error(fmt::format("{}: register: {}", watch.path.string(), error.what()));
  }
}

// `server`: of the watch file; null where it follows a folder.
std::unique_ptr<Source> source_of(const WatchFile& watch, const Orthanc* server, const Clock& clock) {
  if (!watch.orthanc) return std::make_unique<FolderSource>(watch.folder, clock);
  return std::make_unique<OrthancSource>(*server, watch.orthanc->url, watch.results / "objects", clock);
}

void run_watch(const std::filesystem::path& file, Console& console) {
  const WatchFile watch = read_watch_file(file);
  const RegisterOptions flags = checked_registration_flags(watch);
  const GracefulEnd end;
  SystemClock clock;
  const auto server = watch.orthanc ? std::make_unique<RestOrthanc>(*watch.orthanc) : nullptr;
  const auto source = source_of(watch, server.get(), clock);
  ChildRunner runner;
  DicomSender sender;
  const FileContents contents;
  ConsoleObserver observer(console), sending(console);
  Watch room(watch, {.source = *source,
                     .runner = runner,
                     .sender = sender,
                     .clock = clock,
                     .observer = observer,
                     .sending = sending,
                     .contents = contents,
                     .takes_other_xrays = !flags.study.machine.empty()});
  observer.say(fmt::format("watching {}; results in {}", watch.orthanc ? watch.orthanc->url : watch.folder.string(),
                           watch.results.string()));
  room.run([&] { return end.is_asked_for(); });
}

}  // namespace

void add_watch_command(CLI::App& app, Console& console, int& exit_status) {
  auto file = std::make_shared<std::filesystem::path>();
  CLI::App* command =
      app.add_subcommand("watch", "Register X-rays as they arrive from a treatment room, and hold the results");
  command->footer(
      "\nExample:\n  isoshift room watch /etc/isoshift/watch.json\n\n"
      "Follows a folder or an Orthanc server until it is stopped. index.html in the folder of the results lists the\n"
      "sessions. Nothing is sent before it is released. docs/commands/watch.md describes the watch file.");
  command
      ->add_option(
          "file", *file,
          "Watch file: the folder or server to follow, the folder for results, and the peers that receive them")
      ->required()
      ->type_name("FILE");
  command->callback([file, &console, &exit_status] {
    run_watch(*file, console);
    exit_status = kExitAccepted;
  });
}

}  // namespace isoshift
