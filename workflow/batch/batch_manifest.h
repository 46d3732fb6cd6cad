#pragma once
// The list of studies that a batch registers: a table (CSV) or JSON lines, one case per line (docs/commands/batch.md).

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "io/dicom/notes.h"
#include "io/study/study_files.h"

namespace isoshift {

struct BatchCase {
  std::string name;  // also the name of its folder: letters, digits, ".", "_" and "-"
  StudyParts parts;
  std::string anatomy;                   // empty: the anatomy of --anatomy
  std::string xrays_sha256;              // what xrays_sha256_of() said when the manifest was written; empty: not known
  std::set<std::string> xray_uids = {};  // SOPInstanceUIDs; known only of a case that was found in a folder

  // Cases with equal keys share their CT.
  std::string ct_key() const;
};

// Of the contents of the case's X-ray files, in their order. Throws Error for a file that cannot be read.
std::string xrays_sha256_of(const BatchCase& one);

// Paths in a manifest are relative to its folder. Throws Error naming the line and the column of a mistake.
std::vector<BatchCase> read_manifest(const std::filesystem::path& path);

// The manifest as CSV. Paths are not changed. Throws Error for a path that holds the separator of paths.
std::string manifest_csv(const std::vector<BatchCase>& cases);

// Makes a case for every session of X-rays below a folder. X-rays that belong to no case are listed in the notes, with
// the reason.
std::vector<BatchCase> scan_cases(const std::filesystem::path& folder, bool other_xrays, Notes& notes);

}  // namespace isoshift
