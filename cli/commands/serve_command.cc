// isoshift serve: the room's screen, as web pages.

#include <fmt/format.h>

#include <memory>

#include "base/graceful_end.h"
#include "cli/commands/commands.h"
#include "cli/commands/register_command.h"
#include "io/config/serve_file.h"
#include "io/report/canvas.h"
#include "serve/http_server.h"
#include "serve/pam.h"
#include "serve/room.h"
#include "serve/screen.h"
#include "serve/sign_ins.h"

namespace isoshift {
namespace {

void run_serve(const std::filesystem::path& file, Console& console) {
  const ServeFile serve = read_serve_file(file);
  const GracefulEnd end;
  SystemClock clock;
  Room room(serve.watch, clock);
  SignIns sign_ins(serve, clock, [&](const std::string& user, const std::string& password) {
    return is_password_of(serve.pam_service, user, password);
  });
  Desk desk(room, clock, register_options_from);
  Screen screen(room, desk, sign_ins, clock, serve.proxy.has_value());
  HttpServer server({.address = serve.address, .port = serve.port, .tls = serve.tls},
                    [&](const HttpRequest& request) { return screen.answer(request); });
  ConsoleObserver observer(console);
  observer.say(fmt::format("serving {} at {}://{}:{}", serve.watch.results.string(), serve.tls ? "https" : "http",
                           serve.address.find(':') == std::string::npos ? serve.address : "[" + serve.address + "]",
                           server.port()));
  server.run([&] { return end.is_asked_for(); }, [&](const std::string& trouble) { observer.say(printable(trouble)); });
}

}  // namespace

void add_serve_command(CLI::App& app, Console& console, int& exit_status) {
  auto file = std::make_shared<std::filesystem::path>();
  CLI::App* command =
      app.add_subcommand("serve", "Show the sessions of a treatment room in browsers, and release them");
  command->footer(
      "\nExample:\n  isoshift serve /etc/isoshift/serve.json\n\n"
      "Shows what isoshift watch has registered, until it is stopped. Whoever may, releases results there.\n"
      "docs/commands/serve.md describes the serve file.");
  command->add_option("file", *file, "Serve file: the watch file, where to listen, who signs users in, and their roles")
      ->required()
      ->type_name("FILE");
  command->callback([file, &console, &exit_status] {
    run_serve(*file, console);
    exit_status = kExitAccepted;
  });
}

}  // namespace isoshift
