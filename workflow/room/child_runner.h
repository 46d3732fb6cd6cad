#pragma once
// Registers in a child process, so that a crash of a registration does not end the program.

#include <chrono>
#include <memory>

#include "workflow/register/registration_process.h"
#include "workflow/room/runner.h"

namespace isoshift {

class ChildRunner : public Runner {
 public:
  explicit ChildRunner(std::chrono::milliseconds limit = kLongestRegistration) : limit_(limit) {}

  void begin(const RegistrationOrder& order) override;
  std::optional<End> end() override;
  void give_up() override { child_.reset(); }

 private:
  std::chrono::milliseconds limit_;  // a registration that takes longer is ended
  std::unique_ptr<RegistrationProcess> child_;
};

}  // namespace isoshift
