#pragma once
// Results appear whole or not at all: written aside, flushed, then renamed into place.

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace isoshift {

// A folder that is being filled beside its final place. commit() moves it there; without commit() nothing remains.
//
//   OutputFolder output("results/today", overwrite);
//   write_text(output.path() / "report.txt", report);
//   output.commit();
class OutputFolder {
 public:
  // Throws Error if `destination` holds anything and `overwrite` is false, or if nothing can be written beside it.
  // `obsolete` names files of an earlier result that must not survive beside the new one.
  OutputFolder(std::filesystem::path destination, bool overwrite, std::vector<std::string> obsolete = {});
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  const std::filesystem::path& path() const { return staging_; }
  const std::filesystem::path& destination() const { return destination_; }

  // Flushes all files to the disk and moves them to the destination. Where that existed, files of the same names are
  // replaced one by one, others stay.
  void commit();

 private:
  std::filesystem::path destination_;
  std::filesystem::path staging_;
  std::vector<std::string> obsolete_;
};

// The whole text or an Error naming the file.
void write_text(const std::filesystem::path& path, std::string_view text);

}  // namespace isoshift
