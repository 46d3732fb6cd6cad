#include <signal.h>
#include <unistd.h>

#include <iostream>
#include <string_view>
#include <thread>

#include "base/graceful_end.h"
#include "base/output_folder.h"
#include "cli/commands/commands.h"
#include "io/dicom/decoder_process.h"

namespace {

// SIGINT and SIGTERM end the program without leaving half a result behind, or ask its work to end
// (base/graceful_end.h): a thread of its own waits for them, since hardly anything may be done in a handler.
void end_cleanly_on_signals() {
  static sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);  // inherited by every thread made later
  std::thread([] {
    int signal = 0;
    do {
      sigwait(&signals, &signal);
    } while (isoshift::ask_for_end());
    isoshift::abandon_outputs();
    ::_exit(128 + signal);
  }).detach();
}

}  // namespace

int main(int argc, char** argv) {
  // Not commands for people: the child that decodes compressed pixels, and the manual that the build makes.
  if (argc == 2 && std::string_view(argv[1]) == "__decode") return isoshift::run_decoder();
  if (argc == 3 && std::string_view(argv[1]) == "__manual") return isoshift::write_manual(argv[2]), 0;
  isoshift::use_decoder("/proc/self/exe");
  end_cleanly_on_signals();
  isoshift::Console console{.out = std::cout, .err = std::cerr, .err_is_terminal = ::isatty(STDERR_FILENO) == 1};
  return isoshift::run_isoshift(argc, argv, console);
}
