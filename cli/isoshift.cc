#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>
#include <signal.h>
#include <unistd.h>

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
#include <type_traits>
#include <vector>

#include "base/error.h"
#include "base/version.h"
#include "cli/commands/commands.h"
#include "cli/man_pages.h"
#include "io/report/canvas.h"

namespace isoshift {
namespace {

constexpr const char* kDescription =
    "isoshift compares the planning CT with the X-rays taken in the treatment room, finds how far the patient lies "
    "off\n"
    "plan, and says how the couch must move. Not for clinical use unless validated by the site.\n\n"
    "Example:\n"
    "  isoshift inspect exported/            # what is in the folder, and what is missing\n"
    "  isoshift register exported/ -o out    # finds the shift; writes out/report.txt, result.json, ...\n";

constexpr const char* kFooter = "\nExit status: 0 accepted (or done), 1 failed, 2 usage, 3 review, 4 rejected.";

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

void add_commands(CLI::App& app, Console& console, int& exit_status) {
  app.footer(kFooter);
  app.require_subcommand(1);
  app.set_version_flag("--version", fmt::format("isoshift {} ({})", kVersion, kCommit));
  app.get_formatter()->column_width(34);
  add_inspect_command(app, console, exit_status);
  add_check_command(app, console, exit_status);
  add_report_command(app, console, exit_status);
  add_register_command(app, console, exit_status);
  add_batch_command(app, console, exit_status);
  add_drr_command(app, console, exit_status);
  add_phantom_command(app, console, exit_status);
  add_deidentify_command(app, console, exit_status);
  add_bundle_command(app, console, exit_status);
  add_evaluate_command(app, console, exit_status);
  add_track_command(app, console, exit_status);
  add_predict_command(app, console, exit_status);
  add_commission_command(app, console, exit_status);
  add_geometry_command(app, console, exit_status);
  add_scout_command(app, console, exit_status);
  add_watch_command(app, console, exit_status);
  add_serve_command(app, console, exit_status);
  add_view_command(app, console, exit_status);
  add_release_command(app, console, exit_status);
  add_delete_command(app, console, exit_status);
  add_audit_command(app, console, exit_status);
  add_audit_setup_command(app, console, exit_status);
  add_bench_command(app, console, exit_status);
  for (CLI::App* command : app.get_subcommands({})) expect_whole_numbers(*command);
}

// CLI11 would say only that a command is missing, or of what stands before it that the command lacks it.
void check_command(const CLI::App& app, std::span<const char* const> words) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands({})) names.push_back(command->get_name());
  const auto is_command = [&](std::string_view word) { return std::ranges::count(names, word) > 0; };
  const auto command = std::ranges::find_if(words, is_command);
  if (words.empty() || command == words.begin()) return;
  const std::string_view first = words.front();
  if (!first.starts_with('-'))
    throw UsageError(fmt::format("there is no command {}; the commands are {}", first, fmt::join(names, ", ")));
  if (command != words.end() && app.get_option_no_throw(std::string(first)) == nullptr)
    throw UsageError(fmt::format("{} belongs behind the command: isoshift {} ... {}", first, *command, first));
}

// "--site: " for the value of a flag.
std::string flag_before(std::span<const char* const> words, std::size_t n) {
  const std::string_view before = n > 0 ? words[n - 1] : "";
  return before.starts_with('-') ? std::string(before) + ": " : "";
}

// An empty value comes from a variable of a script that is unset: what it was meant to switch on would be left out. No
// limit holds for what is not a number.
void check_words(std::span<const char* const> words) {
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
}

int run_isoshift(int argc, const char* const* argv, Console& console) {
  int exit_status = kExitAccepted;
  CLI::App app(kDescription, "isoshift");
  add_commands(app, console, exit_status);
  try {
    const auto words = std::span(argv, static_cast<std::size_t>(argc)).subspan(1);
    check_command(app, words);
    check_words(words);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) {  // the help, or the version
      app.exit(error, console.out, console.err);
      return after_printing(kExitAccepted, console);
    }
    console.err << "error: " << printable_lines(error.what())
                << "\n       isoshift COMMAND --help explains the flags\n";
    return kExitUsage;
  } catch (const UsageError& error) {
    return say(console, error, kExitUsage);
  } catch (const std::bad_alloc&) {
    console.err << "error: out of memory\n";
    return kExitFailed;
  } catch (const std::filesystem::filesystem_error& error) {
    return say(console, Error(fmt::format("{}: {}", error.path1().string(), error.code().message())), kExitFailed);
  } catch (const std::exception& error) {
    return say(console, error, kExitFailed);
  }
  return after_printing(exit_status, console);
}

}  // namespace isoshift
