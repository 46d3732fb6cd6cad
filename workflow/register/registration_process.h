#pragma once
// One registration in a child process: its parent hears how far it is, may end it, and survives its crash.

#include <chrono>
#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "base/process.h"
#include "workflow/register/registration_messages.h"

namespace isoshift {

class RegistrationProcess {
 public:
  // Begins it. A registration that takes longer than `limit` is ended. Throws Error if the program cannot be run.
  explicit RegistrationProcess(const RegistrationOrder& order, std::chrono::milliseconds limit = kLongestRegistration);

  // What the child told last, if the order asks it to tell.
  const Progressed& progress() const { return progress_; }

  struct End {
    std::string failure;  // why there is no result; empty: it is in the order's output folder
    bool is_late = false;
    std::map<std::string, std::string> files = {};  // SHA-256 by name, of all files that the child wrote there
  };
  // How it ended; nothing while it runs. Never waits.
  std::optional<End> end();

 private:
  std::string failure_of(const ProcessEnd& end) const;
  void hear(const std::string& line);

  std::chrono::milliseconds limit_;
  Process process_;
  Progressed progress_;
  std::optional<Ended> ended_;
  std::string failure_;  // that the child told
};

}  // namespace isoshift
