// isoshift room serve: the room's screen, as web pages.

#include <fmt/format.h>

#include <memory>

#include "base/error.h"
#include "base/graceful_end.h"
#include "base/system_user.h"
#include "cli/commands/commands.h"
#include "cli/commands/register_command.h"
#include "io/config/serve_file.h"
#include "io/report/canvas.h"
#include "serve/example_room.h"
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
  HttpServerOptions http{.address = serve.address, .port = serve.port, .tls = serve.tls};
  if (serve.proxy) http.most_of_address = http.most_connections;  // all requests come from there
  HttpServer server(http, [&](const HttpRequest& request) { return screen.answer(request); });
  ConsoleObserver observer(console);
  observer.say(fmt::format("serving {} at {}://{}:{}", serve.watch.results.string(), serve.tls ? "https" : "http",
                           serve.address.find(':') == std::string::npos ? serve.address : "[" + serve.address + "]",
                           server.port()));
  server.run([&] { return end.is_asked_for(); }, [&](const std::string& trouble) { observer.say(printable(trouble)); });
}

}  // namespace

void add_serve_command(CLI::App& app, Console& console, int& exit_status) {
  struct Options {
    std::filesystem::path file, example;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("serve", "Show the sessions of a treatment room in browsers, and release them");
  command->footer(
      "\nExamples:\n  isoshift room serve /etc/isoshift/serve.json\n  isoshift room serve --init room\n\n"
      "Shows what isoshift room watch has registered, until it is stopped. Whoever may, releases results there.\n"
      "docs/commands/serve.md describes the serve file; docs/treatment-room.md leads through a first room.");
  CLI::Option* file =
      command
          ->add_option("file", options->file,
                       "Serve file: the watch file, where to listen, who signs users in, and their roles")
          ->type_name("FILE");
  CLI::Option* example =
      command
          ->add_option("--init", options->example,
                       "Instead: writes the files of a room to try into a new folder, with two Orthanc servers, "
                       "certificates and keys. Its README.txt says how to go on")
          ->type_name("FOLDER");
  file->excludes(example);
  command->callback([options, &console, &exit_status] {
    if (options->file.empty() && options->example.empty())
      throw UsageError("FILE or --init FOLDER: expected one of them: the serve file");
    if (options->example.empty()) {
      run_serve(options->file, console);
    } else {
      write_example_room(options->example, system_user().name);
      console.out << fmt::format("{} says how to go on\n", (options->example / "README.txt").string());
    }
    exit_status = kExitAccepted;
  });
}

}  // namespace isoshift
