#include "workflow/room/orthanc_source.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/json_file.h"
#include "base/output_folder.h"
#include "base/sha256.h"
#include "io/study/files_below.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr const char *kState = ".orthanc.json", *kSuffix = ".dcm";
constexpr int kChangesAtOnce = 200;

}  // namespace

OrthancSource::OrthancSource(const Orthanc& server, std::string url, fs::path objects, const Clock& clock)
    : server_(server), url_(std::move(url)), objects_(std::move(objects)), clock_(clock), files_(clock) {
  std::error_code error;
  fs::create_directories(objects_, error);
  if (error) throw Error(fmt::format("{}: cannot be made: {}", objects_.string(), error.message()));
  if (!fs::exists(objects_ / kState)) return;
  const nlohmann::json state = read_json_file(objects_ / kState).json;
  if (state.at("url") != url_) return;  // another server
  last_change_ = state.at("last_change");
  last_mark_ = state.at("last_mark");
  for (const std::string instance : state.at("not_fetched")) unfetched_[instance];
}

fs::path OrthancSource::object_of(const std::string& instance) const { return objects_ / (instance + kSuffix); }

bool OrthancSource::is_coming(const std::string& /*patient_id*/) const {
  constexpr std::chrono::seconds kLongestWait(60);
  return !has_all_changes_ || std::ranges::any_of(unfetched_, [&](const auto& entry) {
    return clock_.now() - entry.second.since < kLongestWait;
  });
}

// The objects are written first, then what is known of the server's changes: whoever is stopped between asks for some
// again.
void OrthancSource::update(Notes& notes) {
  if (!has_read_objects_) read_objects(notes);
  has_read_objects_ = true;
  has_all_changes_ = false;
  if (!has_checked_server_) check_server(notes);
  has_checked_server_ = true;
  const Orthanc::Changes changes = server_.changes_since(last_change_, kChangesAtOnce);
  if (changes.last < last_change_) {  // another database
    last_change_ = 0;
    is_listed_ = false;
    return;
  }
  for (const std::string& instance : changes.instances) unfetched_[instance] = {.since = clock_.now()};
  for (auto& [patient_id, when] : rest_)
    if (when <= clock_.now()) find_rest(patient_id, notes);
  for (const auto& [instance, attempts] : std::map(unfetched_))
    if (attempts.again.is_due(clock_.now())) fetch(instance, notes);
  has_all_changes_ = changes.done;
  last_change_ = changes.last;
  if (!changes.mark.empty()) last_mark_ = changes.mark;
  if (changes.done && !std::exchange(is_listed_, true)) compare_with_list();
  save_state();
}

// A list of changes that somebody has cleared tells of nothing that came before.
void OrthancSource::compare_with_list() {
  for (const std::string& instance : server_.instances())
    if (!useless_.contains(instance) && !fs::exists(object_of(instance)))
      unfetched_.emplace(instance, Attempts{.since = clock_.now()});
}

// Another database under the same address has another change of that number, or none; so has a list of changes that was
// cleared.
void OrthancSource::check_server(Notes& notes) {
  const std::string mark = last_change_ == 0 ? "" : server_.changes_since(last_change_ - 1, 1).mark;
  is_listed_ = !mark.empty() && mark == last_mark_;
  if (mark == last_mark_) return;
  notes.warnings.push_back(
      fmt::format("Orthanc at {}: holds another database than before, or its list of changes was cleared; all of it is "
                  "read again",
                  url_));
  last_change_ = 0;
}

void OrthancSource::save_state() {
  nlohmann::json state = {{"url", url_},
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
void OrthancSource::read_objects(Notes& notes) {
  for (const auto& entry : fs::directory_iterator(objects_))
    if (entry.path().filename().string().starts_with('.') && entry.path().filename() != kState)
      fs::remove(entry.path());
  for (const fs::path& object : files_below({objects_}))
    if (!keep(object, notes)) unfetched_[object.stem().string()];
}

// If the server does not deliver an instance, the instance is asked for again after longer and longer times, and the
// others do not wait for it. If the server does not answer at all, nothing else is asked for in this round.
void OrthancSource::fetch(const std::string& instance, Notes& notes) {
  std::string content;
  try {
    content = server_.file_of(instance);
  } catch (const ServerError& error) {
    put_off(instance, error, notes);
    throw;
  } catch (const Error& error) {
    put_off(instance, error, notes);
    return;
  }
  const fs::path file = object_of(instance);
  const bool is_there = fs::exists(file);
  if (!content.empty() && (!is_there || sha256_of_file(file) != sha256_of(content))) {
    if (is_there)
      notes.warnings.push_back(fmt::format("{}: the server has replaced this object by another one", file.string()));
    replace_text(file, content);
    keep(file, notes);
    if (!files_.known().contains(file)) useless_.insert(instance);
  }
  unfetched_.erase(instance);
}

void OrthancSource::put_off(const std::string& instance, const Error& error, Notes& notes) {
  constexpr int kSaid = 5;
  Attempts& attempts = unfetched_[instance];
  attempts.again.fail(clock_.now());
  if (++attempts.count == kSaid)
    notes.warnings.push_back(fmt::format("the server does not deliver an instance: {}", error.what()));
}

void OrthancSource::find_rest(const std::string& patient_id, Notes& notes) {
  Clock::Time& next = rest_[patient_id];
  next = Clock::Time::max();
  const auto one =
      std::ranges::find(files_.known(), patient_id, [](const auto& entry) { return entry.second.patient_id; });
  if (one == files_.known().end()) return;
  try {
    for (const std::string& instance : server_.instances_beside(one->first.stem().string()))
      if (!useless_.contains(instance) && !fs::exists(object_of(instance)))
        unfetched_.emplace(instance, Attempts{.since = clock_.now()});
  } catch (const Error& error) {
    next = clock_.now() + 1min;
    notes.warnings.push_back(error.what());
  }
}

void OrthancSource::forget_before(fs::file_time_type time, const std::set<std::string>& but) {
  std::map<std::string, std::vector<fs::path>> old;  // by patient
  std::set<std::string> others;
  for (const auto& [file, known] : files_.known()) {
    std::error_code gone;
    if (fs::last_write_time(file, gone) >= time && !gone)
      others.insert(known.patient_id);
    else
      old[known.patient_id].push_back(file);
  }
  for (const auto& [patient_id, files] : old) {
    if (others.contains(patient_id) || but.contains(patient_id)) continue;
    for (const fs::path& file : files) {
      fs::remove(file);
      files_.forget(file);
    }
  }
}

// An object of which nothing is made goes again: the server has it. What differs from another of its UID stays as
// evidence.
bool OrthancSource::keep(const fs::path& object, Notes& notes) {
  const PatientFiles::Taken taken = files_.take(object, notes);
  if (taken.replaced) fs::remove(*taken.replaced);
  const auto known = files_.known().find(object);
  if (known != files_.known().end())
    rest_.erase(known->second.patient_id);
  else if (!taken.differs)
    fs::remove(object);
  return !files_.unreadable().contains(object);
}

}  // namespace isoshift
