#include "cli/switches/options_as_typed.h"

#include <fmt/format.h>

namespace isoshift {

std::vector<std::string> options_as_typed(const CLI::App& command, const std::set<std::string>& except) {
  std::vector<std::string> typed;
  for (const CLI::Option* option : command.get_options()) {
    const std::string name = option->get_single_name();
    if (option->count() == 0 || except.contains(name)) continue;
    for (const std::string& result : option->results())
      typed.push_back(option->get_expected_max() == 0 ? "--" + name : fmt::format("--{}={}", name, result));
  }
  return typed;
}

}  // namespace isoshift
