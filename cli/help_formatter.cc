#include "cli/help_formatter.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>

namespace isoshift {
namespace {

constexpr std::size_t kDefaultColumns = 80, kFewestColumns = 60, kMostColumns = 120;

// The first `columns` columns of a line, up to a space; of a first word that is longer, up to a comma, or all of it.
std::size_t words_within(std::string_view line, std::size_t columns) {
  if (line.size() <= columns) return line.size();
  const std::size_t before = line.rfind(' ', columns);
  if (before != line.npos && before > line.find_first_not_of(' ')) return before;
  if (const std::size_t comma = line.rfind(',', columns - 1); comma != line.npos) return comma + 1;
  return std::min(line.find(' ', columns), line.size());
}

std::string filled(std::string_view line, std::size_t width, std::size_t indent, std::string_view continued = "") {
  const std::string margin(indent, ' ');
  std::string lines;
  std::size_t room = std::max(width, indent + 20) - indent;
  for (;;) {
    const bool is_last = line.size() <= room;
    const std::size_t end = words_within(line, is_last ? room : room - continued.size());
    lines += margin + std::string(line.substr(0, end));
    line = line.substr(std::min(line.find_first_not_of(' ', end), line.size()));
    if (line.empty()) return lines;
    lines += std::string(continued) + "\n";
  }
}

std::string example(std::string_view line, std::size_t width, std::size_t indent) {
  if (line.size() + indent <= width) return std::string(indent, ' ') + std::string(line);
  const std::size_t margin = line.find_first_not_of(' ');
  const std::size_t comment = line.find("  # ");
  if (comment != line.npos && comment > margin) {
    const std::size_t end = line.find_last_not_of(' ', comment);
    return filled(line.substr(comment + 2), width, indent + margin) + "\n" +
           example(line.substr(0, end + 1), width, indent);
  }
  const std::string_view words = line.substr(margin);
  if (words.starts_with('#')) return filled(words, width, indent + margin);
  const std::size_t end = words_within(words, width - indent - margin - 2);
  if (end == words.size()) return std::string(indent, ' ') + std::string(line);
  return std::string(indent + margin, ' ') + std::string(words.substr(0, end)) + " \\\n" +
         filled(words.substr(words.find_first_not_of(' ', end)), width, indent + margin + 4, " \\");
}

// " TEXT:{setup,fast}=setup" as " {setup, fast}=setup", and " FLOAT:FLOAT in [0 - 1]" as " FLOAT in [0 - 1]".
std::string readable(std::string type) {
  for (const std::string_view named_twice : {"TEXT:{", "FLOAT:FLOAT", "INT:INT", "UINT:UINT"})
    if (const std::size_t at = type.find(named_twice); at != type.npos) type.erase(at, named_twice.find(':') + 1);
  for (std::size_t at = type.find('{'); at < type.size() && type[at] != '}'; ++at)
    if (type[at] == ',') type.insert(at + 1, " ");
  return type;
}

}  // namespace

std::string wrapped(std::string_view text, std::size_t width, std::size_t indent) {
  std::string lines;
  for (;;) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    if (!line.empty()) lines += line.starts_with(' ') ? example(line, width, indent) : filled(line, width, indent);
    if (end == text.size()) return lines;
    lines += '\n';
    text.remove_prefix(end + 1);
  }
}

std::size_t terminal_columns() {
  winsize size{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return kDefaultColumns;
  return std::clamp(static_cast<std::size_t>(size.ws_col), kFewestColumns, kMostColumns);
}

std::string HelpFormatter::make_description(const CLI::App* app) const {
  return wrapped(Formatter::make_description(app), width_);
}

std::string HelpFormatter::make_usage(const CLI::App* app, std::string name) const {
  std::string usage = Formatter::make_usage(app, std::move(name));
  const std::size_t subcommand = usage.find("SUBCOMMAND");
  if (subcommand != usage.npos) usage.replace(subcommand, std::string_view("SUBCOMMAND").size(), "COMMAND");
  return "\n" + wrapped(usage, width_);
}

std::string HelpFormatter::make_footer(const CLI::App* app) const {
  return wrapped(Formatter::make_footer(app), width_);
}

std::string HelpFormatter::make_subcommand(const CLI::App* command) const {
  return entry(command->get_display_name(true), command->get_description());
}

std::string HelpFormatter::make_option(const CLI::Option* option, bool is_positional) const {
  return entry(make_option_name(option, is_positional) + readable(make_option_opts(option)), make_option_desc(option));
}

std::string HelpFormatter::entry(const std::string& name, const std::string& description) const {
  std::string head = "  " + name;
  if (description.empty()) return wrapped(head, width_) + "\n";
  const std::size_t column = std::min(column_width_, width_ / 2 - 6);
  const std::string text = wrapped(description, width_, column);
  if (head.size() < column) return head + text.substr(head.size()) + "\n";
  return filled(name, width_, 2) + "\n" + text + "\n";
}

}  // namespace isoshift
