#include "cli/isoshift.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>
#include <type_traits>
#include <vector>

#include "base/error.h"
#include "base/output_folder.h"
#include "base/version.h"
#include "cli/commands/commands.h"
#include "cli/completion.h"
#include "cli/help_formatter.h"
#include "cli/man_pages.h"
#include "cli/suggestion.h"
#include "io/report/canvas.h"

namespace isoshift {
namespace {

constexpr const char* kDescription =
    "isoshift compares the planning CT with the X-rays taken in the treatment room, finds how far the patient lies "
    "off plan, and says how the couch must move. Not for clinical use unless validated by the site.\n\n"
    "Example:\n"
    "  isoshift inspect exported/            # what is in the folder, and what is missing\n"
    "  isoshift register exported/ -o out    # finds the shift; writes the report\n";

constexpr const char* kFooter =
    "\nisoshift help COMMAND explains a command.\n"
    "Exit status: 0 accepted (or done), 1 failed, 2 usage, 3 review, 4 rejected.";

// Every command and family below an app.
template <class App, class Do>
void for_each_command(App& app, const Do& act) {
  for (auto* command : app.get_subcommands({})) {
    act(*command);
    for_each_command(*command, act);
  }
}

// Names of files and sessions may hold what a terminal would obey.
int say(Console& console, const std::exception& error, int status) {
  console.err << "error: " << printable_lines(error.what()) << "\n";
  return status;
}

template <class Number>
std::string check_whole_number(const std::string& word) {
  Number number{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (error == std::errc() && fmt::format("{}", number) == word) return {};
  return fmt::format("{}: expected a whole number{} in decimal digits", word,
                     std::is_signed_v<Number> ? "" : " from 0 on");
}

// CLI11 reads 010 as 8, and takes what is too large, or negative where that cannot be, for the largest number.
void expect_whole_numbers(CLI::App& command) {
  for (CLI::Option* option : command.get_options()) {
    const std::string type = option->get_type_name();
    const std::string_view kind = std::string_view(type).substr(0, type.find(':'));
    if (kind == "UINT") option->check(CLI::Validator(&check_whole_number<std::uint64_t>, ""));
    if (kind == "INT" || kind == "N") option->check(CLI::Validator(&check_whole_number<std::int64_t>, ""));
  }
}

using AddCommand = void (*)(CLI::App& app, Console& console, int& exit_status);

// Commands that stand together under a name: isoshift room watch.
CLI::App& add_family(CLI::App& app, const char* name, const char* description) {
  CLI::App& family = *app.add_subcommand(name, description);
  family.require_subcommand(1);
  return family;
}

void add_commands(CLI::App& app, Console& console, int& exit_status) {
  app.formatter(std::make_shared<HelpFormatter>(terminal_columns()));
  app.get_formatter()->column_width(28);
  app.footer(kFooter);
  app.require_subcommand(1);
  app.set_version_flag("--version", fmt::format("isoshift {} ({})", kVersion, kCommit));
  const auto add = [&](CLI::App& parent, const char* group, std::initializer_list<AddCommand> commands) {
    const std::size_t before = parent.get_subcommands({}).size();
    for (const AddCommand command : commands) command(parent, console, exit_status);
    const std::vector<CLI::App*> all = parent.get_subcommands({});
    for (std::size_t n = before; n < all.size(); ++n) all[n]->group(group);
  };
  add(app, "Register",
      {add_inspect_command, add_register_command, add_batch_command, add_view_command, add_track_command});
  add(app, "Check and share", {add_report_command, add_check_command, add_deidentify_command, add_bundle_command});
  add(app, "Try and measure",
      {add_drr_command, add_phantom_command, add_evaluate_command, add_predict_command, add_bench_command});
  CLI::App& room =
      add_family(app, "room", "Run a treatment room: register X-rays as they arrive, show and release them");
  CLI::App& qa = add_family(app, "qa", "Commission and supervise: localization, imagers, CT scouts, a year of shifts");
  for (CLI::App* family : {&room, &qa}) family->group("Room and quality assurance");
  add(room, "Commands",
      {add_watch_command, add_serve_command, add_release_command, add_delete_command, add_audit_command});
  add(qa, "Commands", {add_commission_command, add_geometry_command, add_scout_command, add_audit_setup_command});
  for_each_command(app, [](CLI::App& command) { expect_whole_numbers(command); });
}

// How a command is called behind `isoshift`: "room watch".
std::string path_of(const CLI::App& command) {
  const CLI::App* parent = command.get_parent();
  return parent == nullptr ? "" : path_of(*parent) + (path_of(*parent).empty() ? "" : " ") + command.get_name();
}

// The command that these words would call, were it not mistyped; nothing where none is like it.
std::string command_like(const CLI::App& app, std::string_view word) {
  std::vector<std::string> names, paths;
  for_each_command(app, [&](const CLI::App& command) {
    names.push_back(command.get_name());
    paths.push_back(path_of(command));
  });
  names.emplace_back("help");
  paths.emplace_back("help");
  const std::string name = suggestion(word, names);
  return name.empty() ? "" : paths[static_cast<std::size_t>(std::ranges::find(names, name) - names.begin())];
}

std::string did_you_mean(const std::string& what) { return what.empty() ? "" : "; did you mean " + what + "?"; }

// How a command is called in a shell.
std::string called(const CLI::App& command) {
  const std::string path = path_of(command);
  return path.empty() ? "isoshift" : "isoshift " + path;
}

std::vector<std::string> flags_of(const CLI::App& command) {
  std::vector<std::string> flags;
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) flags.push_back("--" + name);
  return flags;
}

std::string unknown_flag(const CLI::App& command, std::string_view flag) {
  return fmt::format("{} has no flag {}{}", called(command), flag, did_you_mean(suggestion(flag, flags_of(command))));
}

// A flag that is mistyped is named before one that is missing. -1,2 and -.5 are numbers, and -ofolder is the flag -o.
void check_flags(const CLI::App& command, std::span<const std::string> words) {
  for (const std::string& word : words) {
    if (word == "--") return;
    if (word.size() < 2 || word[0] != '-' || (word[1] != '-' && !std::isalpha(static_cast<unsigned char>(word[1]))))
      continue;
    const std::string flag = word[1] == '-' ? word.substr(0, word.find('=')) : word.substr(0, 2);
    if (command.get_option_no_throw(flag) == nullptr) throw UsageError(unknown_flag(command, flag));
  }
}

// The command whose flags and arguments were being read.
const CLI::App& command_read(const CLI::App& app) {
  const std::vector<CLI::App*> below = app.get_subcommands();
  return below.empty() ? app : command_read(*below.back());
}

// CLI11 would say only that a command is missing, or of what stands before it that the command lacks it.
void check_command(const CLI::App& app, std::span<const std::string> words) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands({})) names.push_back(command->get_name());
  if (names.empty()) return check_flags(app, words);
  const std::string program = called(app);
  if (words.empty())
    throw UsageError(fmt::format("{} needs a command: {}\n       {} --help explains them", program,
                                 fmt::join(names, ", "), program));
  const std::string& first = words.front();
  const auto command = std::ranges::find_first_of(words, names);
  if (command == words.begin()) return check_command(*app.get_subcommand(first), words.subspan(1));
  if (first.starts_with('-')) {
    if (app.get_option_no_throw(first) != nullptr) return;
    throw UsageError(command == words.end()
                         ? unknown_flag(app, first)
                         : fmt::format("{} belongs behind the command: {} {} ... {}", first, program, *command, first));
  }
  const std::string meant = command_like(app, first);
  throw UsageError(
      meant.empty() ? fmt::format("{} has no command {}; its commands are {}", program, first, fmt::join(names, ", "))
                    : fmt::format("{} has no command {}; did you mean isoshift {}?", program, first, meant));
}

// What was wrong with the words behind a command whose flags are known.
std::string usage_error(const CLI::App& app, const CLI::ParseError& error) {
  if (error.get_exit_code() != static_cast<int>(CLI::ExitCodes::ExtrasError)) return error.what();
  return fmt::format("{} does not expect {}", called(command_read(app)), fmt::join(app.remaining(true), " "));
}

// "--site: " for the value of a flag.
std::string flag_before(std::span<const std::string> words, std::size_t n) {
  const std::string_view before = n > 0 ? std::string_view(words[n - 1]) : "";
  return before.starts_with('-') ? std::string(before) + ": " : "";
}

// An empty value comes from a variable of a script that is unset: what it was meant to switch on would be left out. No
// limit holds for what is not a number.
void check_words(std::span<const std::string> words) {
  for (std::size_t n = 0; n < words.size(); ++n) {
    const std::string_view word = words[n];
    const std::size_t equals = word.starts_with("--") ? word.find('=') : word.npos;
    const std::string flag = equals == word.npos ? flag_before(words, n) : std::string(word.substr(0, equals)) + ": ";
    const std::string_view value = equals == word.npos ? word : word.substr(equals + 1);
    if (value.empty()) throw UsageError(flag + "the argument is empty");
    std::istringstream parts(std::string(value.substr(value.find('=') + 1)));  // LABEL=NUMBER
    for (std::string part; std::getline(parts, part, ',');) {
      std::string number = part.substr(part.starts_with('-') || part.starts_with('+') ? 1 : 0);
      std::ranges::transform(number, number.begin(), [](unsigned char c) { return std::tolower(c); });
      if (number == "nan" || number == "inf" || number == "infinity")
        throw UsageError(fmt::format("{}{} is not a finite number (a file of this name is ./{})", flag, part, part));
    }
  }
}

// Whoever read the output has had enough of it (isoshift ... | head).
bool is_reader_gone() {
  pollfd output{.fd = STDOUT_FILENO, .events = POLLOUT, .revents = 0};
  return ::poll(&output, 1, 0) > 0 && (output.revents & POLLERR) != 0;
}

int after_printing(int exit_status, Console& console) {
  if (console.out.flush()) return exit_status;
  if (is_reader_gone()) return 128 + SIGPIPE;
  console.err << "error: standard output cannot be written to (is the disk full?): not all that was printed is there\n";
  return kExitFailed;
}

}  // namespace

void write_manual(const std::filesystem::path& folder) {
  std::ostringstream nobody;
  Console console{.out = nobody, .err = nobody};
  int exit_status = 0;
  CLI::App app(kDescription, "isoshift");
  add_commands(app, console, exit_status);
  write_man_pages(app, folder);
  replace_text(folder / "isoshift.bash", bash_completion(app));
}

int run_isoshift(int argc, const char* const* argv, Console& console) {
  int exit_status = kExitAccepted;
  CLI::App app(kDescription, "isoshift");
  add_commands(app, console, exit_status);
  try {
    std::vector<std::string> words(argv + 1, argv + argc);
    if (!words.empty() && words.front() == "help") {  // isoshift help room watch
      std::erase(words, "help");
      words.push_back("--help");
    }
    check_words(words);
    check_command(app, words);
    std::ranges::reverse(words);  // as CLI11 takes them
    app.parse(words);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {  // the help, or the version
      app.exit(error, console.out, console.err);
      return after_printing(kExitAccepted, console);
    }
    console.err << "error: " << printable_lines(usage_error(app, error)) << "\n       " << called(command_read(app))
                << " --help explains the flags\n";
    return kExitUsage;
  } catch (const UsageError& error) {
    return say(console, error, kExitUsage);
  } catch (const std::bad_alloc&) {
    console.err << "error: out of memory\n";
    return kExitFailed;
  } catch (const std::filesystem::filesystem_error& error) {
    return say(console, Error(fmt::format("{}: {}", error.path1().string(), error.code().message())), kExitFailed);
  } catch (const std::system_error& error) {  // "Resource temporarily unavailable"
    return say(console,
               Error(fmt::format("the system refused a thread or another of its resources ({}): memory or the number "
                                 "of threads may be limited (ulimit -a)",
                                 error.code().message())),
               kExitFailed);
  } catch (const std::exception& error) {
    return say(console, error, kExitFailed);
  }
  return after_printing(exit_status, console);
}

}  // namespace isoshift
