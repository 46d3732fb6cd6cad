#pragma once
// The results of many sessions: all that `register`, `batch` or `watch` left below a folder.

#include <filesystem>
#include <string>
#include <vector>

#include "setup/setup_result.h"

namespace isoshift {

struct NamedFolder {
  std::string name;  // its own; where several have one name, with the folders above it
  std::filesystem::path path;
};

// The folders of all results, by path. Results that were put aside (superseded, registered by hand and handed over) are
// left out. Throws Error for a folder without any result.
std::vector<NamedFolder> result_folders_below(const std::filesystem::path& top);

struct NamedResult {
  std::string name;  // of its folder
  SetupResult result;

  // When its first X-ray was acquired, "2026-03-01 10:15:00"; empty: unknown.
  std::string acquired() const;
};

struct ResultsBelow {
  struct Failed {
    std::string name, message;
  };
  std::vector<NamedResult> results;  // in order of acquisition, then of names
  std::vector<Failed> failed;        // cases of a batch that ended with an error, by name
};

// All of them. Throws Error as result_folders_below() does, and naming the file for a result that cannot be read.
ResultsBelow results_below(const std::filesystem::path& top);

// Throws Error naming two results of the same X-ray: statistics would count it twice.
void require_distinct(const std::vector<NamedResult>& results);

}  // namespace isoshift
