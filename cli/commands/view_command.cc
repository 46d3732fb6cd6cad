// isoshift view: a study in the browser of the person at this computer, for a look and for registration by hand.

#include <fmt/format.h>

#include <atomic>
#include <memory>

#include "base/error.h"
#include "base/graceful_end.h"
#include "base/random_word.h"
#include "base/system_user.h"
#include "cli/commands/commands.h"
#include "cli/commands/register_command.h"
#include "cli/switches/options_as_typed.h"
#include "cli/switches/registration_switches.h"
#include "cli/switches/study_switches.h"
#include "io/report/canvas.h"
#include "serve/http_server.h"
#include "serve/view_screen.h"
#include "workflow/register/start_pose.h"
#include "workflow/room/clock.h"

namespace isoshift {
namespace {

// The options that say what is shown, not how it is registered.
const std::set<std::string> kOfTheView = {
    "study", "ct", "image", "plan", "structures", "output", "port", "start", "source-isocenter", "help"};

void run_view(const RegisterOptions& options, std::uint16_t port, const std::vector<std::string>& typed,
              Console& console) {
  ConsoleObserver observer(console);
  const LiveStudy study(options.study, observer);
  Notes notes;
  ManualRegistration registration({.parts = options.study.parts, .flags = typed}, options.output);
  ManualScreen manual(study, registration,
                      options.start.empty()
                          ? Eigen::Isometry3d::Identity()
                          : read_start(options.start, study.study(), options.source_isocenter, notes).setup_error);
  print_warnings(notes.warnings, console);

  const std::string user = system_user().name;
  ServeFile serve;
  serve.roles[user] = {Role::kView, Role::kRegister};
  SystemClock clock;
  const std::string word = random_word();
  std::atomic<bool> is_used = false;
  SignIns sign_ins(
      serve, clock,
      [&](const std::string&, const std::string& password) { return password == word && !is_used.exchange(true); },
      {.idle = std::chrono::hours(12)});
  ViewScreen screen(manual, sign_ins, user);

  const GracefulEnd end;
  HttpServer server({.address = serve.address, .port = port},
                    [&](const HttpRequest& request) { return screen.answer(request); });
  console.out << fmt::format("Open http://{}:{}/open/{} in a browser of this computer; it opens once.\n", serve.address,
                             server.port(), word)
              << std::flush;
  server.run([&] { return end.is_asked_for(); }, [&](const std::string& trouble) { observer.say(printable(trouble)); });
}

}  // namespace

void add_view_command(CLI::App& app, Console& console, int& exit_status) {
  auto options = std::make_shared<RegisterOptions>();
  auto port = std::make_shared<std::uint16_t>(0);
  CLI::App* command = app.add_subcommand("view", "Look at a study in a browser, and register it by hand");
  command->footer(
      "\nExample:\n  isoshift view exported/ -o by-hand\n\n"
      "Prints an address for a browser of this computer, and serves nobody else, until it is stopped (Ctrl+C). Every\n"
      "registration from there leaves a result in a folder of its own: by-hand/1, by-hand/2 and so on.");
  add_study_options(*command, options->study);
  command->add_option("-o,--output", options->output, "Folder for the results")->required()->type_name("FOLDER");
  command->add_option("--port", *port, "Port to listen at [any that is free]");
  add_start_option(*command, *options);
  add_result_options(*command, *options);
  add_registration_switches(*command, options->registration);
  command->callback([options, port, command, &console, &exit_status] {
    options->registration.settle();
    run_view(*options, *port, options_as_typed(*command, kOfTheView), console);
    exit_status = kExitAccepted;
  });
}

}  // namespace isoshift
