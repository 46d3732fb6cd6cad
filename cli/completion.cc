#include "cli/completion.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <vector>

namespace isoshift {
namespace {

// The branches of the script's three case statements, for a command and for those below it.
struct Branches {
  std::string commands;  // which words lead to which command
  std::string values;    // what follows a flag with a choice of values
  std::string words;     // commands and flags that follow a command
};

// "TEXT:{setup,fast,paper}" names the values.
std::string values_of(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const std::size_t begin = type.find('{'), end = type.find('}');
  if (begin == type.npos || end == type.npos) return {};
  std::string values = type.substr(begin + 1, end - begin - 1);
  std::ranges::replace(values, ',', ' ');
  return values;
}

// `called`: how the command is called, " room watch"; nothing for the program itself.
void add_branches(const CLI::App& command, const std::string& called, Branches& branches) {
  std::vector<std::string> words;
  if (command.get_parent() == nullptr) words.emplace_back("help");
  for (const CLI::App* below : command.get_subcommands({})) {
    words.push_back(below->get_name());
    const std::string name = called + " " + below->get_name();
    branches.commands += fmt::format("      \"{0}\") command=\"{0}\" ;;\n", name);
    add_branches(*below, name, branches);
  }
  for (const CLI::Option* option : command.get_options())
    for (const std::string& name : option->get_lnames()) {
      words.push_back("--" + name);
      if (const std::string values = values_of(*option); !values.empty())
        branches.values += fmt::format("    \"{} --{}\") words=\"{}\" ;;\n", called, name, values);
    }
  branches.words += fmt::format("      \"{}\") words=\"{}\" ;;\n", called, fmt::join(words, " "));
}

}  // namespace

std::string bash_completion(const CLI::App& app) {
  Branches branches;
  add_branches(app, "", branches);
  return fmt::format(R"(# Completion of isoshift in bash, made from its --help by the build.
_isoshift() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD - 1]}} command="" words="" word
  # --preset=s comes as three words
  if [[ $before = "=" ]]; then before=${{COMP_WORDS[COMP_CWORD - 2]}}; fi
  if [[ $current = "=" ]]; then current=""; fi
  for word in "${{COMP_WORDS[@]:1:COMP_CWORD-1}}"; do
    case "$command $word" in
      " help") ;;
{}      *) break ;;
    esac
  done
  case "$command $before" in
{}    *) case "$command" in
{}    esac ;;
  esac
  COMPREPLY=($(compgen -W "$words" -- "$current"))
}}
complete -o default -F _isoshift isoshift
)",
                     branches.commands, branches.values, branches.words);
}

}  // namespace isoshift
