#include "cli/inbox.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <set>

#include "geometry/error.h"
#include "io/dicom_dataset.h"
#include "io/output_folder.h"
#include "io/sha256.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

constexpr const char *kLastChange = ".last-change", *kSuffix = ".dcm";

// Whether it is there and can be read to its end.
bool is_whole(const fs::path& file) {
  try {
    DicomFile::read(file, DicomFile::Extent::kWhole);
    return true;
  } catch (const Error&) {
    return false;
  }
}

void remove_from(StudyFiles& files, const fs::path& file, const std::string& uid) {
  for (StudyFiles::Ct& ct : files.cts)
    if (std::erase(ct.files, file) > 0) ct.sop_instance_uids.erase(uid);
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
  saved_change_ = last_change_;
}

std::optional<Inbox::Known> Inbox::known_in(const StudyFiles& one) {
  if (!one.cts.empty()) return Known{one.cts.front().patient, *one.cts.front().sop_instance_uids.begin()};
  if (!one.plans.empty()) return Known{one.plans.front().patient, one.plans.front().sop_instance_uid};
  if (!one.structures.empty()) return Known{one.structures.front().patient, one.structures.front().sop_instance_uid};
  for (const auto& images : {one.images, one.other_xrays})
    if (!images.empty()) return Known{images.front().patient, images.front().sop_instance_uid};
  return std::nullopt;
}

void Inbox::update(Notes& notes) {
  if (orthanc_)
    update_orthanc(notes);
  else
    update_folder(notes);
}

void Inbox::update_folder(Notes& notes) {
  const std::vector<fs::path> files = files_below({watch_.folder});
  std::vector<fs::path> gone;
  for (const auto& [file, version] : done_)
    if (!std::ranges::binary_search(files, file)) gone.push_back(file);
  for (const fs::path& file : gone) {
    done_.erase(file);
    forget(file);
  }
  std::map<fs::path, Version> still_growing;
  for (const fs::path& file : files) {
    std::error_code error;
    const Version version{fs::file_size(file, error), fs::last_write_time(file, error)};
    const auto done = done_.find(file), before = growing_.find(file);
    if (error || (done != done_.end() && done->second == version)) continue;
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
  for (auto& [patient, is_done] : rest_)
    if (!is_done) find_rest(patient), is_done = true;
  for (const auto& [instance, tries] : std::map(unfetched_)) fetch(instance, notes);
  has_all_changes_ = changes.done;
  last_change_ = changes.last;
  if (!unfetched_.empty() || last_change_ == saved_change_) return;
  replace_text(objects_ / kLastChange, fmt::format("{}\n", last_change_));
  saved_change_ = last_change_;
}

// One that the server does not give is tried some times more, and holds up no other.
void Inbox::fetch(const std::string& instance, Notes& notes) {
  constexpr int kMostTries = 5;
  const fs::path file = objects_ / (instance + kSuffix);
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

void Inbox::find_rest(const std::string& patient) {
  const auto one = std::ranges::find(known_, patient, [](const auto& entry) { return entry.second.patient; });
  if (one == known_.end()) return;
  for (const std::string& instance : orthanc_->instances_beside(one->first.stem().string()))
    if (!fs::exists(objects_ / (instance + kSuffix))) unfetched_.emplace(instance, 0);
}

void Inbox::forget_before(fs::file_time_type time) {
  if (!orthanc_) return;
  std::map<std::string, std::vector<fs::path>> old;  // by patient
  std::set<std::string> others;
  for (const auto& [file, known] : known_) {
    std::error_code gone;
    if (fs::last_write_time(file, gone) >= time && !gone)
      others.insert(known.patient);
    else
      old[known.patient].push_back(file);
  }
  for (const auto& [patient, files] : old) {
    if (others.contains(patient)) continue;
    for (const fs::path& file : files) {
      fs::remove(file);
      forget(file);
    }
  }
}

void Inbox::forget(const fs::path& file) {
  const auto known = known_.find(file);
  if (known == known_.end()) return;
  const auto& [patient, uid] = known->second;
  const auto copies = copies_of_.equal_range(uid);
  for (auto copy = copies.first; copy != copies.second; ++copy)
    done_.erase(copy->second);  // one of them takes its place
  copies_of_.erase(copies.first, copies.second);
  file_of_uid_.erase(uid);
  StudyFiles& files = patients_.at(patient).files;
  remove_from(files, file, uid);
  if (files.cts.empty() && files.plans.empty() && files.structures.empty() && files.images.empty() &&
      files.other_xrays.empty())
    patients_.erase(patient);
  known_.erase(known);
}

void Inbox::take(const fs::path& file, Notes& notes) {
  forget(file);  // another content under a name that was there before
  StudyFiles one;
  try {
    add_file(file, one);
  } catch (const Error& error) {
    notes.warnings.push_back(fmt::format("left out: {}", error.what()));
    return;
  }
  const std::optional<Known> found = known_in(one);
  if (!found) return;
  if (const auto earlier = file_of_uid_.find(found->uid); earlier != file_of_uid_.end()) {
    const fs::path before = earlier->second;
    if (is_whole(before)) {
      patients_.at(known_.at(before).patient).last = Clock::now();
      copies_of_.emplace(found->uid, file);
      if (sha256_of_file(before) != sha256_of_file(file))
        notes.warnings.push_back(fmt::format("{}: left out: differs from {}, which has the same SOPInstanceUID",
                                             file.string(), before.string()));
      return;
    }
    forget(before);
  }
  file_of_uid_[found->uid] = file;
  known_[file] = *found;
  rest_.erase(found->patient);
  Patient& patient = patients_[found->patient];
  patient.last = Clock::now();
  merge(std::move(one), patient.files);
}

}  // namespace isoshift
