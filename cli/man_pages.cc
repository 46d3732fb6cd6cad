#include "cli/man_pages.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "base/output_folder.h"
#include "base/version.h"
#include "cli/help_formatter.h"

namespace isoshift {
namespace {

constexpr std::size_t kColumns = 71;  // of lines that man does not fill, behind its margin

// A text as roff takes it: as it is.
std::string roff(const std::string& text) {
  std::string escaped;
  bool begins = true;
  for (const char c : text) {
    if (begins && (c == '.' || c == '\'')) escaped += "\\&";
    if (c == '\\')
      escaped += "\\e";
    else if (c == '-')
      escaped += "\\-";
    else
      escaped += c;
    begins = c == '\n';
  }
  return escaped;
}

// The same of a long list of names, which may be broken behind a comma.
std::string breakable(const std::string& text) {
  std::string page = roff(text);
  for (std::size_t comma = page.find(','); comma != page.npos; comma = page.find(',', comma + 1))
    page.insert(comma + 1, "\\:");
  return page;
}

// Lines that are to stay lines.
std::string preformatted(const std::string& text) { return ".nf\n" + roff(wrapped(text, kColumns)) + "\n.fi\n"; }

// A text that is filled, but begins a line where its author did.
std::string paragraph(const std::string& text) {
  std::string page;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) page += (page.empty() ? "" : ".br\n") + roff(line) + "\n";
  return page;
}

std::string options_of(const CLI::App& command) {
  const CLI::Formatter formatter;
  std::string page;
  for (const std::string& group : command.get_groups()) {
    std::string entries;
    for (const CLI::Option* option : command.get_options()) {
      if (option->get_group() != group || group.empty()) continue;
      entries +=
          fmt::format(".TP\n\\fB{}\\fR{}\n{}", roff(formatter.make_option_name(option, option->get_positional())),
                      breakable(formatter.make_option_opts(option)), paragraph(option->get_description()));
    }
    if (entries.empty()) continue;
    if (group != "Options") page += ".SS " + roff(group) + "\n";
    page += entries;
  }
  return page;
}

// What a command is called with, "[OPTIONS] [study]".
std::string arguments_of(const CLI::App& command) {
  const CLI::Formatter formatter;
  std::string arguments = command.get_subcommands({}).empty() ? "[OPTIONS]" : "COMMAND [OPTIONS]";
  for (const CLI::Option* option : command.get_options())
    if (option->get_positional()) arguments += " " + formatter.make_option_usage(option);
  return arguments;
}

std::string page_name(std::string called) {
  std::ranges::replace(called, ' ', '-');
  return called;
}

// The page of a command, and those of the commands below it. `called`: as in a shell, "isoshift room watch", whose page
// is isoshift-room-watch(1).
void write_pages(const CLI::App& command, const std::string& called, const std::string& summary,
                 const std::filesystem::path& folder) {
  const std::string name = page_name(called);
  const auto commands = command.get_subcommands({});
  std::string page = fmt::format(".TH {} 1 \"\" \"isoshift {}\"\n.SH NAME\n{} \\- {}\n", roff(name), kVersion,
                                 roff(name), roff(summary));
  page += fmt::format(".SH SYNOPSIS\n\\fB{}\\fR {}\n", roff(called), roff(arguments_of(command)));
  if (command.get_parent() == nullptr) page += ".SH DESCRIPTION\n" + preformatted(command.get_description());
  page += ".SH OPTIONS\n" + options_of(command);
  if (!commands.empty()) page += ".SH COMMANDS\n";
  for (const CLI::App* below : commands) {
    const std::string called_below = called + " " + below->get_name();
    page += fmt::format(".TP\n\\fB{}\\fR(1)\n{}", roff(page_name(called_below)), paragraph(below->get_description()));
    write_pages(*below, called_below, below->get_description(), folder);
  }
  if (!command.get_footer().empty()) page += ".SH NOTES\n" + preformatted(command.get_footer());
  replace_text(folder / (name + ".1"), page);
}

}  // namespace

void write_man_pages(const CLI::App& app, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  write_pages(app, "isoshift", "2D/3D registration of treatment-room X-rays with the planning CT", folder);
}

}  // namespace isoshift
