#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>
#include <exception>
#include <iostream>
#include <memory>
#include <string_view>
#include <thread>
#include <vector>

#include "base/graceful_end.h"
#include "base/option_name.h"
#include "base/output_folder.h"
#include "base/process.h"
#include "cli/commands/register_command.h"
#include "cli/isoshift.h"
#include "io/dicom/decoder_process.h"
#include "workflow/register/serve_registrations.h"

namespace {

// SIGINT, SIGTERM and, if nobody wants it ignored (nohup), SIGHUP end the program without leaving half a result behind,
// or ask its work to end (base/graceful_end.h): a thread of its own waits for them, since hardly anything may be done
// in a handler.
void end_cleanly_on_signals() {
  static sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  struct sigaction hang_up{};
  sigaction(SIGHUP, nullptr, &hang_up);
  if (hang_up.sa_handler != SIG_IGN) sigaddset(&signals, SIGHUP);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);  // inherited by every thread made later
  // Who writes to a pipe or to a peer that went away, or beyond the limit of a file's size, reports that.
  ::signal(SIGPIPE, SIG_IGN);
  ::signal(SIGXFSZ, SIG_IGN);
  std::thread([] {
    int signal = 0;
    do {
      sigwait(&signals, &signal);
    } while (isoshift::ask_for_end());
    isoshift::abandon_outputs();
    ::_exit(128 + signal);
  }).detach();
}

// Memory for what remains to be done where there is none left.
std::unique_ptr<std::vector<char>> reserve = std::make_unique<std::vector<char>>(1 << 20);

// Where a library ends the program (GLib and fontconfig do where memory runs out) or goes on without the memory that it
// was refused, or the system refuses a thread or memory at a place that cannot report it, nothing half written stays.
// By rights a handler may do hardly anything: if it hangs, an alarm ends it.
void end_without_traces(int signal) {
  ::signal(signal, SIG_DFL);
  ::alarm(5);
  reserve.reset();
  constexpr std::string_view kWhy = "error: the program had to end, probably because memory or threads ran out\n";
  (void)!::write(STDERR_FILENO, kWhy.data(), kWhy.size());
  isoshift::abandon_outputs();
  ::raise(signal);
}

// Sanitizers have handlers of their own.
void end_without_traces_on_failures() {
  for (const int signal : {SIGABRT, SIGTRAP, SIGSEGV, SIGBUS}) {  // GLib traps
    struct sigaction present{};
    ::sigaction(signal, nullptr, &present);
    if (present.sa_handler == SIG_DFL) ::signal(signal, &end_without_traces);
  }
}

// With less, threads end without a word in the midst of their work.
bool is_stack_too_small() {
  constexpr rlim_t kLeastBytes = 1 << 20;
  rlimit stack{};
  return ::getrlimit(RLIMIT_STACK, &stack) == 0 && stack.rlim_cur < kLeastBytes;
}

// Whatever is written is of patients: at most its owner's group may read it, however it is written.
void keep_from_strangers() {
  constexpr mode_t kWithheld = S_IWGRP | S_IRWXO;
  ::umask(::umask(kWithheld) | kWithheld);
}

}  // namespace

int main(int argc, char** argv) {
  keep_from_strangers();
  end_without_traces_on_failures();
  ::unsetenv("DCMDICTPATH");  // no variable of a shell may change what DCMTK takes attributes for
  isoshift::name_options(isoshift::OptionStyle::kFlags);
  // Not commands for people: what this program runs as its child, and the manual that the build makes.
  const std::string_view hidden = argc == 3 ? argv[1] : "", role = argc == 3 ? argv[2] : "";
  if (hidden == "__manual") return isoshift::write_manual(argv[2]), 0;
  if (is_stack_too_small()) {
    std::cerr << "error: the stack of a thread may have less than 1 MB here; 8 MB are usual (ulimit -s 8192)\n";
    return isoshift::kExitFailed;
  }
  isoshift::use_decoder(isoshift::decoder_of("/proc/self/exe"));
  end_cleanly_on_signals();
  if (hidden == "__child" && role == "register") {
    isoshift::Channel parent(isoshift::parent_socket());
    isoshift::serve_registrations(parent, isoshift::register_options_from);
    return 0;
  }
  isoshift::Console console{.out = std::cout, .err = std::cerr, .err_is_terminal = ::isatty(STDERR_FILENO) == 1};
  return isoshift::run_isoshift(argc, argv, console);
}
