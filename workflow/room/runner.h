#pragma once
// Registers sessions in the background, one at a time.

#include <map>
#include <optional>
#include <string>

#include "workflow/register/registration_messages.h"

namespace isoshift {

class Runner {
 public:
  virtual ~Runner() = default;

  // Begins a registration. The result will be in the order's folder, whole or not at all. Throws Error if the
  // registration cannot begin.
  virtual void begin(const RegistrationOrder& order) = 0;

  struct Failure {
    std::string why;
    bool may_be_over_soon = true;  // another attempt with the same files may succeed
  };
  struct End {
    std::optional<Failure> failure = std::nullopt;  // unset: the result is in the folder
    std::map<std::string, std::string> files = {};  // SHA-256 by name, of all files that the registration wrote there
  };
  // How the registration ended; nothing while it runs. An end is returned once.
  virtual std::optional<End> end() = 0;

  // Ends the current registration without a result.
  virtual void give_up() = 0;
};

}  // namespace isoshift
