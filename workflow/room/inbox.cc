#include "workflow/room/inbox.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/json_file.h"
#include "base/output_folder.h"
#include "base/sha256.h"
#include "io/dicom/dicom_dataset.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr const char *kState = ".orthanc.json", *kSuffix = ".dcm";
constexpr std::chrono::seconds kLongestWait(60);

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
  if (!fs::exists(objects_ / kState)) return;
  const nlohmann::json state = read_json_file(objects_ / kState).json;
  if (state.at("url") != watch_.orthanc->url) return;  // another server
  last_change_ = state.at("last_change");
  last_mark_ = state.at("last_mark");
  for (const std::string instance : state.at("not_fetched")) unfetched_[instance];
}

std::optional<Inbox::Known> Inbox::known_in(const StudyFiles& one) {
  const auto known = [](const auto& entry) { return Known{patient_id_of(entry.patient), entry.sop_instance_uid}; };
  if (!one.cts.empty())
    return Known{patient_id_of(one.cts.front().patient), *one.cts.front().sop_instance_uids.begin()};
  if (!one.plans.empty()) return known(one.plans.front());
  if (!one.structures.empty()) return known(one.structures.front());
  if (!one.images.empty()) return known(one.images.front());
  if (!one.other_xrays.empty()) return known(one.other_xrays.front());
  return std::nullopt;
}

// What is there of a file may tell already whose it is.
Inbox::Growing Inbox::growing(const fs::path& file, const Version& version) {
  Growing growing{.version = version, .since = Clock::now(), .patient_id = ""};
  try {
    if (const auto known = known_in(scan_file(file))) growing.patient_id = known->patient_id;
  } catch (const Error&) {
    // It does not yet.
  }
  return growing;
}

bool Inbox::is_coming(const std::string& patient_id) const {
  const auto now = Clock::now();
  const auto is_near = [&](const auto& entry) { return now - entry.second.since < kLongestWait; };
  const auto is_of_this = [&](const auto& entry) {
    return entry.second.patient_id.empty() ? is_near(entry) : entry.second.patient_id == patient_id;
  };
  return !has_all_changes_ || std::ranges::any_of(growing_, is_of_this) || std::ranges::any_of(unfetched_, is_near);
}

void Inbox::update(Notes& notes) {
  if (orthanc_)
    update_orthanc(notes);
  else
    update_folder(notes);
}

void Inbox::update_folder(Notes& notes) {
  std::set<fs::path> unsearchable;
  const std::vector<fs::path> files = files_below({watch_.folder}, {}, &unsearchable);
  const auto warn_once = [&](const fs::path& path) {
    if (unopened_.insert(path).second) notes.warnings.push_back(fmt::format("{}: cannot be opened", path.string()));
  };
  std::ranges::for_each(unsearchable, warn_once);
  std::vector<fs::path> gone;
  for (const auto& [file, version] : done_)
    if (!std::ranges::binary_search(files, file)) gone.push_back(file);
  for (const fs::path& file : gone) {
    done_.erase(file);
    std::erase_if(copies_of_, [&](const auto& copy) { return copy.second == file; });
    forget(file);
  }
  std::map<fs::path, Growing> still_growing;
  for (const fs::path& file : files) {
    std::error_code error;
    const Version version{fs::file_size(file, error), fs::last_write_time(file, error)};
    const auto done = done_.find(file), end = done_.end();
    if (error || (done != end && done->second == version)) continue;
    if (!std::ifstream(file)) {
      warn_once(file);
      continue;
    }
    unopened_.erase(file);
    if (version.size > 0 && !begins_like_dicom(file)) {
      done_[file] = version;
      forget(file);
      continue;
    }
    const auto before = growing_.find(file);
    if (before != growing_.end() && before->second.version == version) {
      done_[file] = version;
      take(file, notes);
      continue;
    }
    Growing& now = still_growing[file] = growing(file, version);
    if (before != growing_.end()) now.since = before->second.since;
  }
  growing_ = std::move(still_growing);
}

// The objects are written first, then what is known of the server's changes: whoever is stopped between asks for some
// again.
void Inbox::update_orthanc(Notes& notes) {
  if (!has_read_objects_) read_objects(notes);
  has_read_objects_ = true;
  has_all_changes_ = false;
  if (!has_checked_server_) check_server(notes);
  has_checked_server_ = true;
  const Orthanc::Changes changes = orthanc_->changes_since(last_change_);
  if (changes.last < last_change_) {  // another database
    last_change_ = 0;
    return;
  }
  for (const std::string& instance : changes.instances) unfetched_[instance] = {.since = Clock::now()};
  for (auto& [patient_id, when] : rest_)
    if (when <= Clock::now()) find_rest(patient_id, notes);
  for (const auto& [instance, attempts] : std::map(unfetched_))
    if (attempts.again.is_due()) fetch(instance, notes);
  has_all_changes_ = changes.done;
  last_change_ = changes.last;
  if (!changes.mark.empty()) last_mark_ = changes.mark;
  save_state();
}

// Another database under the same address has another change of that number, or none.
void Inbox::check_server(Notes& notes) {
  if (last_change_ == 0 || orthanc_->changes_since(last_change_ - 1, 1).mark == last_mark_) return;
  notes.warnings.push_back(
      fmt::format("Orthanc at {}: holds other changes than before: asked for all of them again", watch_.orthanc->url));
  last_change_ = 0;
}

void Inbox::save_state() {
  nlohmann::json state = {{"url", watch_.orthanc->url},
                          {"last_change", last_change_},
                          {"last_mark", last_mark_},
                          {"not_fetched", nlohmann::json::array()}};
  for (const auto& [instance, attempts] : unfetched_) state["not_fetched"].push_back(instance);
  std::string text = state.dump() + "\n";
  if (text == saved_state_) return;
  replace_text(objects_ / kState, text);
  saved_state_ = std::move(text);
}

// What an earlier run fetched, without what it was writing when it was killed.
void Inbox::read_objects(Notes& notes) {
  for (const auto& entry : fs::directory_iterator(objects_))
    if (entry.path().filename().string().starts_with('.') && entry.path().filename() != kState)
      fs::remove(entry.path());
  for (const fs::path& object : files_below({objects_}))
    if (!keep(object, notes)) unfetched_[object.stem().string()];
}

// One that the server does not give is tried again, after longer and longer times, and holds up no other. Of a server
// that does not answer at all nothing else is asked in this round.
void Inbox::fetch(const std::string& instance, Notes& notes) {
  const fs::path file = objects_ / (instance + kSuffix);
  std::string content;
  const auto fail = [&](const Error& error) {
    Attempts& attempts = unfetched_[instance];
    attempts.again.fail();
    constexpr int kSaid = 5;
    if (++attempts.count == kSaid)
      notes.warnings.push_back(fmt::format("an instance that the server does not give: {}", error.what()));
  };
  try {
    content = orthanc_->file_of(instance);
  } catch (const ServerError& error) {
    fail(error);
    throw;
  } catch (const Error& error) {
    fail(error);
    return;
  }
  const bool is_there = fs::exists(file);
  if (!content.empty() && (!is_there || sha256_of_file(file) != sha256_of(content))) {
    if (is_there) notes.warnings.push_back(fmt::format("{}: the server has replaced it by another", file.string()));
    replace_text(file, content);
    keep(file, notes);
    if (!known_.contains(file)) useless_.insert(instance);
  }
  unfetched_.erase(instance);
}

void Inbox::find_rest(const std::string& patient_id, Notes& notes) {
  Clock::time_point& next = rest_[patient_id];
  next = Clock::time_point::max();
  const auto one = std::ranges::find(known_, patient_id, [](const auto& entry) { return entry.second.patient_id; });
  if (one == known_.end()) return;
  try {
    for (const std::string& instance : orthanc_->instances_beside(one->first.stem().string()))
      if (!useless_.contains(instance) && !fs::exists(objects_ / (instance + kSuffix)))
        unfetched_.emplace(instance, Attempts{.since = Clock::now()});
  } catch (const Error& error) {
    next = Clock::now() + 1min;
    notes.warnings.push_back(error.what());
  }
}

void Inbox::forget_before(fs::file_time_type time) {
  if (!orthanc_) return;
  std::map<std::string, std::vector<fs::path>> old;  // by patient
  std::set<std::string> others;
  for (const auto& [file, known] : known_) {
    std::error_code gone;
    if (fs::last_write_time(file, gone) >= time && !gone)
      others.insert(known.patient_id);
    else
      old[known.patient_id].push_back(file);
  }
  for (const auto& [patient_id, files] : old) {
    if (others.contains(patient_id)) continue;
    for (const fs::path& file : files) {
      fs::remove(file);
      forget(file);
    }
  }
}

void Inbox::forget(const fs::path& file) {
  const auto known = known_.find(file);
  if (known == known_.end()) return;
  const auto& [patient_id, uid] = known->second;
  const auto copies = copies_of_.equal_range(uid);
  for (auto copy = copies.first; copy != copies.second; ++copy) done_.erase(copy->second);  // one takes its place
  copies_of_.erase(copies.first, copies.second);
  file_of_uid_.erase(uid);
  StudyFiles& files = patients_.at(patient_id).files;
  remove_from(files, file, uid);
  if (files.cts.empty() && files.plans.empty() && files.structures.empty() && files.images.empty() &&
      files.other_xrays.empty())
    patients_.erase(patient_id);
  known_.erase(known);
}

// An object of which nothing is made goes again: the server has it.
bool Inbox::keep(const fs::path& object, Notes& notes) {
  const bool is_readable = take(object, notes);
  if (!known_.contains(object)) fs::remove(object);
  return is_readable;
}

bool Inbox::take(const fs::path& file, Notes& notes) {
  forget(file);  // another content under a name that was there before
  StudyFiles one;
  try {
    one = scan_file(file);
  } catch (const Error& error) {
    notes.warnings.push_back(fmt::format("left out: {}", error.what()));
    return false;
  }
  const std::optional<Known> found = known_in(one);
  if (!found) return true;
  if (const auto earlier = file_of_uid_.find(found->uid); earlier != file_of_uid_.end()) {
    const fs::path before = earlier->second;
    if (is_whole(before)) {
      patients_.at(known_.at(before).patient_id).last = Clock::now();
      copies_of_.emplace(found->uid, file);
      if (sha256_of_file(before) != sha256_of_file(file))
        notes.warnings.push_back(fmt::format("{}: left out: differs from {}, which has the same SOPInstanceUID",
                                             file.string(), before.string()));
      return true;
    }
    forget(before);
    if (orthanc_) fs::remove(before);
  }
  file_of_uid_[found->uid] = file;
  known_[file] = *found;
  rest_.erase(found->patient_id);
  Patient& patient = patients_[found->patient_id];
  patient.last = Clock::now();
  merge(std::move(one), patient.files);
  return true;
}

}  // namespace isoshift
