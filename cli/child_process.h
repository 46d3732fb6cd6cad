#pragma once
// Another program, run to its end.

#include <filesystem>
#include <string>
#include <vector>

namespace isoshift {

// The program that children run: this one, or in tests the one that was built.
const std::filesystem::path& this_program();
void use_program(std::filesystem::path program);

struct ChildEnd {
  int status = 0;      // exit status; 128 and the signal for one that a signal ended
  std::string output;  // what it printed, errors too, without the last line's end
};

// The first word is the program, searched for in PATH. Throws Error where it cannot be run.
ChildEnd run_child(std::vector<std::string> words);

}  // namespace isoshift
