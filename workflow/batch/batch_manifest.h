#pragma once
// Which studies a batch registers: a table (CSV) or JSON lines, a case in each (docs/commands/batch.md).

#include <filesystem>
#include <string>
#include <vector>

#include "io/dicom/notes.h"
#include "workflow/register/study_options.h"

namespace isoshift {

struct BatchCase {
  std::string name;  // of its folder: letters, digits, ".", "_" and "-"
  std::filesystem::path study, plan, structures;
  std::vector<std::filesystem::path> ct, images;
  std::string anatomy;  // empty: that of --anatomy

  // The study's parts, over the switches given for all cases.
  StudyOptions options(StudyOptions switches) const;
  // Cases with equal ones share their CT.
  std::string ct_key() const;
};

// Paths in a manifest are relative to its folder. Throws Error naming line and column for anything it cannot hold.
std::vector<BatchCase> read_manifest(const std::filesystem::path& path);

// As CSV, with the paths as they are.
std::string manifest_csv(const std::vector<BatchCase>& cases);

// A case for every session of X-rays below a folder; what belongs to none is said in the notes.
std::vector<BatchCase> scan_cases(const std::filesystem::path& folder, bool other_xrays, Notes& notes);

}  // namespace isoshift
