#pragma once
// Registers in a child process, so that a crash of a registration does not end the program.

#include <chrono>
#include <memory>

#include "io/config/watch_file.h"
#include "workflow/register/registration_process.h"
#include "workflow/room/runner.h"

namespace isoshift {

// Orders registrations with the site file and the flags of a watch file, each from a child of its own.
class ChildRunner : public Runner {
 public:
  explicit ChildRunner(const WatchFile& watch, std::chrono::milliseconds limit = kLongestRegistration)
      : watch_(watch), limit_(limit) {}

  void begin(const StudyParts& parts, const std::filesystem::path& folder) override;
  std::optional<End> end() override;
  void give_up() override { child_.reset(); }

 private:
  const WatchFile& watch_;
  std::chrono::milliseconds limit_;  // a registration that takes longer is ended
  std::unique_ptr<RegistrationProcess> child_;
};

}  // namespace isoshift
