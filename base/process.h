#pragma once
// Another program that runs beside this one. Only this class starts programs, exchanges messages with them, limits
// their time, ends them and waits for their end.
//
//   Process process({"isoshift", "__child", "register"}, {.program = this_program(), .limit = 30min});
//   process.channel().send(order);
//   const ProcessEnd end = process.wait();

#include <sys/types.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/channel.h"

namespace isoshift {

// The program that children run: this one, or in tests the one that was built.
const std::filesystem::path& this_program();
void use_program(std::filesystem::path program);

// The socket by which a child speaks with its parent. What the child prints goes to its standard error from now on, so
// that a message of a library is never taken for a message of the child.
int parent_socket();

// The longest time that a registration may take: one that takes longer is taken to hang.
inline constexpr std::chrono::minutes kLongestRegistration(30);

struct ProcessOptions {
  std::filesystem::path program;                   // empty: the first word, searched for in PATH
  std::optional<std::chrono::milliseconds> limit;  // see Process::allow()
  enum class Errors { kWithOutput, kInherited, kKept, kDropped };
  Errors errors = Errors::kWithOutput;  // where its standard error goes
  int end_signal = SIGTERM;             // sent by ~Process() to a program that still runs
};

struct ProcessEnd {
  int status = 0;        // exit status; 128 and the signal for a program that a signal ended
  int signal = 0;        // that ended it; 0: it ended by itself
  bool is_late = false;  // it was killed because its limit had passed
  std::string output;    // what it printed and nobody took, without the last line's end
  std::string errors;    // the same of its standard error, where it was kept

  // Whether another program killed it: it ended by a signal that programs do not send to themselves.
  bool is_from_outside() const;
};

class Process {
 public:
  // The first word is argv[0]. Throws Error if the program cannot be run.
  explicit Process(std::vector<std::string> words, const ProcessOptions& options = {});
  // Sends the program its end signal, SIGKILL if it still runs 10 s later, and waits for its end.
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  // The program's standard input and output.
  Channel& channel() { return channel_; }

  // From now on the program has this long; without a value as long as it likes. Then end() or kill_if_late() kills it.
  void allow(std::optional<std::chrono::milliseconds> limit);
  Channel::Time deadline() const { return deadline_; }
  void kill_if_late();

  // How it ended; nothing if it still runs after `patience`.
  std::optional<ProcessEnd> end(std::chrono::milliseconds patience);
  // Waits for its end.
  ProcessEnd wait();

 private:
  struct Errors {  // a file in memory that keeps them
    int file = -1;
    ~Errors();
  };
  int start(std::vector<std::string> words, const ProcessOptions& options);
  bool has_ended_by(Channel::Time until);

  int end_signal_;
  Channel::Time deadline_ = Channel::Time::max();
  Errors errors_;
  pid_t process_ = 0;
  Channel channel_;
  ProcessEnd end_;
};

// Runs a program to its end.
ProcessEnd run_to_end(std::vector<std::string> words, std::chrono::milliseconds limit);

}  // namespace isoshift
