#pragma once
// The whole program in one call: what a user types, and what comes back.

#include <string>
#include <vector>

namespace isoshift {

struct CommandOutcome {
  int exit_status = -1;
  std::string out, err;
};

// isoshift with these arguments, in this process.
CommandOutcome run_command(const std::vector<std::string>& arguments);

// A program of the system, through the shell: what it printed to stdout and stderr together, and its exit status.
CommandOutcome run_shell(const std::string& command);

}  // namespace isoshift
