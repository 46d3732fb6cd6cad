#pragma once
// What a case was registered from, so that a batch that continues notices another CT, plan or X-ray under the same
// name.

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "workflow/batch/batch_manifest.h"

namespace isoshift {

class CaseInputs {
 public:
  // `folder`: where a note is kept for every case. `shared`: the files that the flags of the batch name, such as a
  // machine profile; empty paths are left aside.
  CaseInputs(std::filesystem::path folder, std::vector<std::filesystem::path> shared);

  // Notes what the case is registered from. Returns true if it has ended and was registered from something else: from
  // other contents of its files, with another number of doubts, or for another anatomy. If a file of a case that has
  // ended is gone, its note stays. Throws Error if the note cannot be written.
  bool renew(const BatchCase& one, bool has_ended);
  // Notes that the case was not registered from its files: the next renew() finds them changed.
  void note_nothing(const BatchCase& one) const;

 private:
  struct Note {
    std::string quick;  // paths, sizes and times of the files: if it is the same, the contents are not read again
    std::string contents;
  };
  std::optional<Note> note_of(const BatchCase& one) const;
  void write(const BatchCase& one, const Note& note) const;
  std::filesystem::path file_of(const BatchCase& one) const { return folder_ / (one.name + ".json"); }
  std::string quick_of(const BatchCase& one) const;
  std::string contents_of(const BatchCase& one);

  std::filesystem::path folder_;
  std::vector<std::filesystem::path> shared_;
  std::map<std::string, std::string> contents_of_ct_;  // by BatchCase::ct_key(): fractions share a CT
};

}  // namespace isoshift
