#include "workflow/room/folder_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <vector>

#include "base/error.h"
#include "io/dicom/dicom_dataset.h"
#include "io/study/files_below.h"

namespace isoshift {

namespace fs = std::filesystem;

namespace {

constexpr std::chrono::seconds kLongestWait(60);

std::string cannot_be_opened(const fs::path& path) {
  return fmt::format("{}: cannot be opened, or is a link, which is not followed", path.string());
}

}  // namespace

// What is there of a file may tell already whose it is.
FolderSource::Growing FolderSource::growing(const fs::path& file, const Version& version) const {
  Growing growing{.version = version, .since = clock_.now(), .patient_id = ""};
  try {
    if (const auto known = known_file_in(scan_file(file))) growing.patient_id = known->patient_id;
  } catch (const Error&) {
    return growing;  // it does not tell yet
  }
  return growing;
}

bool FolderSource::is_coming(const std::string& patient_id) const {
  return std::ranges::any_of(growing_, [&](const auto& entry) {
    const Growing& file = entry.second;
    return file.patient_id.empty() ? clock_.now() - file.since < kLongestWait : file.patient_id == patient_id;
  });
}

void FolderSource::warn_once(const fs::path& unopened, Notes& notes) {
  if (unopened_.insert(unopened).second) notes.warnings.push_back(cannot_be_opened(unopened));
}

std::vector<std::string> FolderSource::unreadable() const {
  std::vector<std::string> messages;
  for (const auto& [file, message] : files_.unreadable()) messages.push_back(message);
  for (const fs::path& file : unopened_) messages.push_back(cannot_be_opened(file));
  for (const auto& [file, growing] : growing_)
    if (clock_.now() - growing.since >= kLongestWait)
      messages.push_back(fmt::format("{}: has not arrived whole within {} s", file.string(), kLongestWait.count()));
  return messages;
}

void FolderSource::read_again(const std::vector<fs::path>& copies) {
  for (const fs::path& copy : copies) done_.erase(copy);
}

void FolderSource::forget_missing(const std::vector<fs::path>& files) {
  std::vector<fs::path> gone;
  for (const auto& [file, version] : done_)
    if (!std::ranges::binary_search(files, file)) gone.push_back(file);
  std::erase_if(unopened_, [](const fs::path& path) { return !fs::exists(fs::symlink_status(path)); });
  for (const fs::path& file : gone) {
    done_.erase(file);
    files_.forget_copy(file);
    read_again(files_.forget(file));
  }
}

void FolderSource::update(Notes& notes) {
  std::set<fs::path> unsearchable;
  const std::vector<fs::path> files = files_below({folder_}, {}, &unsearchable);
  for (const fs::path& folder : unsearchable) warn_once(folder, notes);
  forget_missing(files);
  std::map<fs::path, Growing> still_growing;
  for (const fs::path& file : files) look_at(file, still_growing, notes);
  growing_ = std::move(still_growing);
}

void FolderSource::look_at(const fs::path& file, std::map<fs::path, Growing>& still_growing, Notes& notes) {
  std::error_code error;
  const Version version{fs::file_size(file, error), fs::last_write_time(file, error)};
  const auto done = done_.find(file), end = done_.end();
  if (error || (done != end && done->second == version)) return;
  if (!std::ifstream(file)) {
    warn_once(file, notes);
    return;
  }
  unopened_.erase(file);
  const Beginning beginning = beginning_of(file);
  const bool is_not_filled = beginning == Beginning::kNothing;
  if (beginning != Beginning::kDicom && !is_named_like_dicom(file)) {
    done_[file] = version;
    read_again(files_.forget(file));
    return;
  }
  const auto before = growing_.find(file);
  if (before != growing_.end() && before->second.version == version && !is_not_filled) {
    done_[file] = version;
    read_again(files_.take(file, notes).copies);
    return;
  }
  Growing& now = still_growing[file] = growing(file, version);
  if (before != growing_.end()) now.since = before->second.since;
}

}  // namespace isoshift
