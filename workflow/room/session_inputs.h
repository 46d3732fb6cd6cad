#pragma once
// The files from which a session was registered, so that it shows when they are others: late slices, a revised plan.

#include <array>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "io/study/study_files.h"

namespace isoshift {

// What tells one file from another.
class FileContents {
 public:
  virtual ~FileContents() = default;
  // Changes when the file is written, replaced or moved. Throws Error for a file that is not there.
  virtual std::string version(const std::filesystem::path& file) const;
  // Its SHA-256. Throws Error for a file that cannot be read.
  virtual std::string sha256(const std::filesystem::path& file) const;
};

struct SessionInputs {
  static constexpr std::array kParts = {"CT", "RT Plan", "RT Structure Set", "X-rays"};
  struct Part {
    std::string versions, contents;  // SHA-256 of those of all files, in no particular order
    bool operator==(const Part&) const = default;
  };
  std::array<Part, kParts.size()> parts;

  bool operator==(const SessionInputs&) const = default;
};

// The files of each part.
std::array<std::vector<std::filesystem::path>, SessionInputs::kParts.size()> files_of(const StudyParts& parts);
// Throws Error for a file that cannot be read.
SessionInputs inputs_of(const StudyParts& parts, const FileContents& contents);
// The same, where nothing is read again of a part whose files have the versions that `before` has.
SessionInputs inputs_of(const StudyParts& parts, const FileContents& contents, const SessionInputs& before);

// Which parts have other contents, in words: "CT and RT Plan". Empty: none.
std::string what_changed(const SessionInputs& before, const SessionInputs& now);
// The same of the files of `parts` as they are now. A part of which a file is gone tells nothing.
std::string what_changed(const SessionInputs& before, const StudyParts& parts, const FileContents& contents);

nlohmann::ordered_json json_of(const SessionInputs& inputs);
// Throws nlohmann::json::exception for anything else.
SessionInputs session_inputs_from(const nlohmann::json& json);

}  // namespace isoshift
