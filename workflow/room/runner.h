#pragma once
// Registers a session beside whatever else goes on, one at a time.

#include <filesystem>
#include <optional>
#include <string>

#include "io/study/study_files.h"

namespace isoshift {

class Runner {
 public:
  virtual ~Runner() = default;

  // Begins to register these parts; a result will be in `folder`, whole or not at all. Throws Error where it cannot.
  virtual void begin(const StudyParts& parts, const std::filesystem::path& folder) = 0;

  struct Failure {
    std::string why;
    bool may_be_over_soon = true;  // the same parts are worth another attempt
  };
  struct End {
    std::optional<Failure> failure;  // unset: the result is in the folder
  };
  // How the registration ended; nothing while it goes on. An end is told once.
  virtual std::optional<End> end() = 0;

  // Ends the registration under way without a result.
  virtual void give_up() = 0;
};

}  // namespace isoshift
