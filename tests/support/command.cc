#include "tests/support/command.h"

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <sstream>

#include "cli/isoshift.h"

namespace isoshift {

CommandOutcome run_command(const std::vector<std::string>& arguments) {
  std::vector<const char*> argv = {"isoshift"};
  for (const std::string& argument : arguments) argv.push_back(argument.c_str());
  std::ostringstream out, err;
  Console console{.out = out, .err = err};
  const int exit_status = run_isoshift(static_cast<int>(argv.size()), argv.data(), console);
  return {.exit_status = exit_status, .out = out.str(), .err = err.str()};
}

CommandOutcome run_shell(const std::string& command) {
  CommandOutcome outcome;
  FILE* pipe = ::popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return outcome;
  std::array<char, 4096> buffer{};
  while (const std::size_t count = std::fread(buffer.data(), 1, buffer.size(), pipe))
    outcome.out.append(buffer.data(), count);
  const int status = ::pclose(pipe);
  outcome.exit_status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return outcome;
}

}  // namespace isoshift
