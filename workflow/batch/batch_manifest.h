#pragma once
// The list of studies that a batch registers: a table (CSV) or JSON lines, one case per line (docs/commands/batch.md).

#include <filesystem>
#include <string>
#include <vector>

#include "io/dicom/notes.h"
#include "io/study/study_files.h"

namespace isoshift {

struct BatchCase {
  std::string name;  // also the name of its folder: letters, digits, ".", "_" and "-"
  StudyParts parts;
  std::string anatomy;  // empty: the anatomy of --anatomy

  // Cases with equal keys share their CT.
  std::string ct_key() const;
};

// Paths in a manifest are relative to its folder. Throws Error naming the line and the column of a mistake.
std::vector<BatchCase> read_manifest(const std::filesystem::path& path);

// The manifest as CSV. Paths are not changed.
std::string manifest_csv(const std::vector<BatchCase>& cases);

// Makes a case for every session of X-rays below a folder. X-rays that belong to no case are listed in the notes, with
// the reason.
std::vector<BatchCase> scan_cases(const std::filesystem::path& folder, bool other_xrays, Notes& notes);

}  // namespace isoshift
