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
  for (const fs::path& file : files_below({watch_.folder})) {
    std::error_code gone;
    const Version version{fs::file_size(file, gone), fs::last_write_time(file, gone)};
    const auto done = done_.find(file), before = growing_.find(file);
    if (gone || (done != done_.end() && done->second == version)) continue;
    if (before == growing_.end() || before->second != version) {
      still_growing[file] = version;
      continue;
    }
    done_[file] = version;
    take(file, notes);
  }
  growing_ = std::move(still_growing);
}

// The server's files are written first, then the number of the change that was the last: whoever is stopped between
// asks for some again.
void Inbox::update_orthanc(Notes& notes) {
  if (!has_read_objects_)
    for (const fs::path& file : files_below({objects_})) take(file, notes);  // of an earlier run
  has_read_objects_ = true;
  has_all_changes_ = false;
  const Orthanc::Changes changes = orthanc_->changes_since(last_change_);
  if (changes.last < last_change_) {  // another database
    last_change_ = 0;
    return;
  }
  for (const std::string& instance : changes.instances) unfetched_.emplace(instance, 0);
  for (const auto& [instance, tries] : std::map(unfetched_)) fetch(instance, notes);
  has_all_changes_ = changes.done;
  if (changes.last == last_change_) return;
  last_change_ = changes.last;
  if (unfetched_.empty()) replace_text(objects_ / kLastChange, fmt::format("{}\n", last_change_));
}

// One that the server does not give is tried some times more, and holds up no other.
void Inbox::fetch(const std::string& instance, Notes& notes) {
  constexpr int kMostTries = 5;
  const fs::path file = objects_ / (sha256_of(instance) + ".dcm");
  try {
    const std::string content = orthanc_->file_of(instance);
    if (!content.empty() && (!fs::exists(file) || sha256_of_file(file) != sha256_of(content))) {
      replace_text(file, content);
      take(file, notes);
    }
    unfetched_.erase(instance);
  } catch (const Error& error) {
    if (++unfetched_[instance] < kMostTries) return;
    notes.warnings.push_back(fmt::format("left out: an instance that the server does not give: {}", error.what()));
    unfetched_.erase(instance);
  }
}

void Inbox::take(const fs::path& file, Notes& notes) {
  if (!taken_.insert(file.native()).second) {  // another content under a name that was there before
    forget(file, files_);
    std::erase_if(file_of_uid_, [&](const auto& entry) { return entry.second == file; });
  }
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
    const fs::path before = entry->second;
    if (is_whole(before)) {
      if (sha256_of_file(before) != sha256_of_file(file))
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
