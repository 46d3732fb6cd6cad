#pragma once
// Registers sessions in the background, one at a time.

#include <filesystem>
#include <optional>
#include <string>

#include "io/study/study_files.h"

namespace isoshift {

class Runner {
 public:
  virtual ~Runner() = default;

  // Begins to register these parts of a study. The result will be in `folder`, whole or not at all. Throws Error if the
  // registration cannot begin.
  virtual void begin(const StudyParts& parts, const std::filesystem::path& folder) = 0;

  struct Failure {
    std::string why;
    bool may_be_over_soon = true;  // another attempt with the same files may succeed
  };
  struct End {
    std::optional<Failure> failure;  // unset: the result is in the folder
  };
  // How the registration ended; nothing while it runs. An end is returned once.
  virtual std::optional<End> end() = 0;

  // Ends the current registration without a result.
  virtual void give_up() = 0;
};

}  // namespace isoshift
