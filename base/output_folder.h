#pragma once
// Results appear whole or not at all: written aside, flushed, then put in place by one rename.

#include <filesystem>
#include <string_view>
#include <vector>

namespace isoshift {

// A folder that is being filled beside its final place. commit() puts it there; without commit() nothing remains.
//
//   OutputFolder output("results/today", overwrite);
//   write_text(output.path() / "report.txt", report);
//   output.commit();
//
// The folder holds one more file, .isoshift, which lists the others: a later run may replace only the files on this
// list.
class OutputFolder {
 public:
  // Throws Error if `destination` holds anything and `overwrite` is false, if it holds anything that no output folder
  // wrote or any of `inputs`, or if nothing can be written beside it.
  OutputFolder(std::filesystem::path destination, bool overwrite,
               const std::vector<std::filesystem::path>& inputs = {});
  ~OutputFolder();
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  const std::filesystem::path& path() const { return staging_; }
  const std::filesystem::path& destination() const { return destination_; }

  // Flushes all files to the disk and puts the folder in its place. An earlier output there is removed as a whole.
  void commit();

 private:
  void make_parents();

  std::filesystem::path destination_;
  std::filesystem::path staging_;
  std::vector<std::filesystem::path> made_parents_;  // outermost first
  bool replaces_ = false;
};

// Removes all uncommitted output folders of this process. For a process that is told to end.
void abandon_outputs() noexcept;

// Waits until a file, or the names in a folder, are on the disk.
void flush(const std::filesystem::path& path);

// Whether a folder is there and holds anything, but for what a replace_text() that was killed has left.
bool holds_files(const std::filesystem::path& folder);

// Replaces the file by the whole text, and flushes it. After an Error the file is as it was before.
void replace_text(const std::filesystem::path& path, std::string_view text);

// Writes the whole text. Throws Error naming the file.
void write_text(const std::filesystem::path& path, std::string_view text);

}  // namespace isoshift
