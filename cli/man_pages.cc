#include "cli/man_pages.h"

#include <fmt/format.h>

#include "base/output_folder.h"
#include "base/version.h"

namespace isoshift {
namespace {

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

// Lines that are to stay lines.
std::string preformatted(const std::string& text) { return ".nf\n" + roff(text) + "\n.fi\n"; }

std::string options_of(const CLI::App& command) {
  const CLI::Formatter formatter;
  std::string page;
  for (const std::string& group : command.get_groups()) {
    std::string entries;
    for (const CLI::Option* option : command.get_options()) {
      if (option->get_group() != group || group.empty()) continue;
      entries +=
          fmt::format(".TP\n\\fB{}\\fR{}\n{}\n", roff(formatter.make_option_name(option, option->get_positional())),
                      roff(formatter.make_option_opts(option)), roff(option->get_description()));
    }
    if (entries.empty()) continue;
    if (group != "Options") page += ".SS " + roff(group) + "\n";
    page += entries;
  }
  return page;
}

std::string page_of(const CLI::App& command, const std::string& name, const std::string& summary) {
  std::string page = fmt::format(".TH {} 1 \"\" \"isoshift {}\"\n.SH NAME\n{} \\- {}\n", roff(name), kVersion,
                                 roff(name), roff(summary));
  const auto commands = command.get_subcommands([](const CLI::App*) { return true; });
  page += fmt::format(".SH SYNOPSIS\n\\fBisoshift\\fR {}\n",
                      commands.empty() ? roff(command.get_name()) + " [OPTIONS]" : "COMMAND [OPTIONS]");
  if (!commands.empty()) page += ".SH DESCRIPTION\n" + preformatted(command.get_description());
  page += ".SH OPTIONS\n" + options_of(command);
  if (!commands.empty()) {
    page += ".SH COMMANDS\n";
    for (const CLI::App* one : commands)
      page += fmt::format(".TP\n\\fBisoshift\\-{}\\fR(1)\n{}\n", roff(one->get_name()), roff(one->get_description()));
  }
  return page + ".SH NOTES\n" + preformatted(command.get_footer());
}

}  // namespace

void write_man_pages(const CLI::App& app, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  replace_text(folder / "isoshift.1",
               page_of(app, "isoshift", "2D/3D registration of treatment-room X-rays with the planning CT"));
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; }))
    replace_text(folder / fmt::format("isoshift-{}.1", command->get_name()),
                 page_of(*command, "isoshift-" + command->get_name(), command->get_description()));
}

}  // namespace isoshift
