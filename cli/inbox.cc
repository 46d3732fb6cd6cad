#include "cli/inbox.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>

#include "geometry/error.h"
#include "io/dicom_dataset.h"
#include "io/output_folder.h"
#include "io/sha256.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLastChange = ".last-change";

// Patient and SOPInstanceUID of a file that was scanned alone; nothing for one that is no part of a study.
struct Scanned {
  std::string patient, uid;
};
std::optional<Scanned> scanned(const StudyFiles& one) {
  if (!one.cts.empty()) return Scanned{one.cts.front().patient, *one.cts.front().sop_instance_uids.begin()};
  if (!one.plans.empty()) return Scanned{one.plans.front().patient, one.plans.front().sop_instance_uid};
  if (!one.structures.empty()) return Scanned{one.structures.front().patient, one.structures.front().sop_instance_uid};
  for (const auto& images : {one.images, one.other_xrays})
    if (!images.empty()) return Scanned{images.front().patient, images.front().sop_instance_uid};
  return std::nullopt;
}

bool is_whole(const fs::path& file) {
  try {
    DicomFile::read(file, DicomFile::Extent::kWhole);
    return true;
  } catch (const Error&) {
    return false;
  }
}

void forget(const fs::path& file, StudyFiles& files) {
  for (StudyFiles::Ct& ct : files.cts) std::erase(ct.files, file);
  std::erase_if(files.cts, [](const auto& ct) { return ct.files.empty(); });
  const auto is_it = [&](const auto& entry) { return entry.file == file; };
  std::erase_if(files.plans, is_it);
  std::erase_if(files.structures, is_it);
  std::erase_if(files.images, is_it);
  std::erase_if(files.other_xrays, is_it);
}

}  // namespace

Inbox::Inbox(const WatchFile& watch, fs::path objects) : watch_(watch), objects_(std::move(objects)) {
  if (!watch_.orthanc) return;
  orthanc_ = std::make_unique<Orthanc>(*watch_.orthanc);
  fs::create_directories(objects_);
  std::ifstream(objects_ / kLastChange) >> last_change_;
}

std::optional<Inbox::Clock::time_point> Inbox::last_of(const std::string& patient) const {
  const auto found = last_of_.find(patient);
  return found == last_of_.end() ? std::nullopt : std::optional(found->second);
}

void Inbox::update(Notes& notes) {
  if (orthanc_)
    update_orthanc(notes);
  else
    update_folder(notes);
}

void Inbox::update_folder(Notes& notes) {
  std::map<fs::path, Version> still_growing;
  for (const fs::path& file : files_below({watch_.folder}, done_files_)) {
    std::error_code gone;
    const Version version{fs::file_size(file, gone), fs::last_write_time(file, gone)};
    if (gone) continue;
    const auto before = growing_.find(file);
    if (before != growing_.end() && before->second == version)
      take(file, notes);
    else
      still_growing[file] = version;
  }
  growing_ = std::move(still_growing);
}

// The server's files are written first, then the number of the change that was the last: whoever is stopped between
// asks for some again.
void Inbox::update_orthanc(Notes& notes) {
  for (const fs::path& file : files_below({objects_}, done_files_)) take(file, notes);  // of an earlier run
  for (bool done = false; !done;) {
    Orthanc::Changes changes = orthanc_->changes_since(last_change_);
    if (changes.last < last_change_) {  // another database
      last_change_ = 0;
      continue;
    }
    for (const std::string& instance : changes.instances) {
      const fs::path file = objects_ / (sha256_of(instance) + ".dcm");
      if (fs::exists(file)) continue;
      const std::string content = orthanc_->file_of(instance);
      if (content.empty()) continue;
      replace_text(file, content);
      take(file, notes);
    }
    done = changes.done;
    if (changes.last == last_change_) continue;
    last_change_ = changes.last;
    replace_text(objects_ / kLastChange, fmt::format("{}\n", last_change_));
  }
}

void Inbox::take(const fs::path& file, Notes& notes) {
  done_files_.insert(file.native());
  StudyFiles one;
  try {
    add_file(file, one);
  } catch (const Error& error) {
    notes.warnings.push_back(fmt::format("left out: {}", error.what()));
    return;
  }
  const auto found = scanned(one);
  if (!found) return;
  last_of_[found->patient] = Clock::now();
  const auto [entry, is_new] = file_of_uid_.emplace(found->uid, file);
  if (!is_new) {
    const fs::path& before = entry->second;
    if (sha256_of_file(before) == sha256_of_file(file)) return;
    if (is_whole(before)) {
      notes.warnings.push_back(fmt::format("{}: left out: differs from {}, which has the same SOPInstanceUID",
                                           file.string(), before.string()));
      return;
    }
    forget(before, files_);
    entry->second = file;
  }
  add_file(file, files_);
}

}  // namespace isoshift
