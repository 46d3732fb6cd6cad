#pragma once
// Another program, run to its end.

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace isoshift {

// The program that children run: this one, or in tests the one that was built.
const std::filesystem::path& this_program();
void use_program(std::filesystem::path program);

// What a registration may take. One that takes longer hangs.
inline constexpr std::chrono::minutes kLongestRegistration(30);

// Descriptors that become a child's standard streams; -1: those of this process.
struct ChildStreams {
  int in = -1, out = -1, err = -1;
};

// Starts a program, searched for in PATH. The first word is what it is told that its name is. Throws Error where it
// cannot be run.
pid_t start_child(const std::string& program, std::vector<std::string> words, const ChildStreams& streams);

struct ChildEnd {
  int status = 0;        // exit status; 128 and the signal for one that a signal ended
  std::string output;    // what it printed, errors too, without the last line's end
  bool is_late = false;  // it was killed, since it did not end
};

// A program that runs beside this one, and is ended with it.
class Child {
 public:
  // The first word is the program, searched for in PATH. Throws Error where it cannot be run.
  Child(std::vector<std::string> words, std::chrono::milliseconds limit);
  ~Child();
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  // Its end, once it has come; waits for it that long.
  std::optional<ChildEnd> end(std::chrono::milliseconds patience);

 private:
  // Takes what it has printed. Whether it goes on.
  bool hear(std::chrono::steady_clock::time_point until);

  int output_ = -1;
  pid_t process_ = 0;
  std::chrono::steady_clock::time_point deadline_;
  ChildEnd end_;
};

// Runs one to its end.
ChildEnd run_child(std::vector<std::string> words, std::chrono::milliseconds limit);

}  // namespace isoshift
