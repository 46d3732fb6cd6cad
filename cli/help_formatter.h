#pragma once
// How the help of a command looks: CLI11's layout, wrapped to the terminal.

#include <CLI/CLI.hpp>
#include <string>
#include <string_view>

namespace isoshift {

// The text in lines of at most `width` columns where words allow, each behind `indent` spaces. A line that begins with
// a space is an example: where it is too long, its comment (behind two spaces and #) moves to a line before it, and the
// command continues on a line of its own behind a backslash.
std::string wrapped(std::string_view text, std::size_t width, std::size_t indent = 0);

// Columns of the terminal on standard output; 80 elsewhere.
std::size_t terminal_columns();

class HelpFormatter : public CLI::Formatter {
 public:
  explicit HelpFormatter(std::size_t width) : width_(width) {}
  std::string make_description(const CLI::App* app) const override;
  std::string make_usage(const CLI::App* app, std::string name) const override;
  std::string make_footer(const CLI::App* app) const override;
  std::string make_subcommand(const CLI::App* command) const override;
  std::string make_option(const CLI::Option* option, bool is_positional) const override;

 private:
  std::string entry(const std::string& name, const std::string& description) const;

  std::size_t width_;
};

}  // namespace isoshift
