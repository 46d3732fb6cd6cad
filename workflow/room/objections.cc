#include "workflow/room/objections.h"

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

#include "base/local_time.h"
#include "io/study/session_files.h"
#include "workflow/room/session_record.h"

namespace isoshift {
namespace {

// Says one thing more; empty words say nothing.
void add_words(const std::string& words, Objection& to) {
  if (!words.empty()) to = {.words = to.words + (to.words.empty() ? "" : "; ") + words};
}

}  // namespace

void Objections::add_result(const std::string& session, const SetupResult& result, bool is_regrouped) {
  OfPatient& patient = patients_[result.identity.patient_id];
  if (is_regrouped) patient.regrouped[session] = result.reasons();
  patient.is_news = true;
  std::set<Xray>& own = patient.results[session];
  for (const SetupResult::View& view : result.views) {
    own.emplace(view.sop_instance_uid, view.acquired);
    patient_of_uid_[view.sop_instance_uid] = result.identity.patient_id;
    // If its file has been seen, that tells more.
    patient.xrays.try_emplace(Xray(view.sop_instance_uid, view.acquired),
                              Seen{.label = view.label, .moment = {.local_s = seconds_at(view.acquired)}});
  }
}

void Objections::add(const std::string& session, const std::string& words) {
  std::vector<std::string>& added = added_[session];
  if (std::ranges::find(added, words) != added.end()) return;
  added.push_back(words);
  for (auto& [patient_id, patient] : patients_)
    if (patient.results.contains(session)) patient.is_news = true;
}

void Objections::inherit(const std::string& from, const std::string& session) {
  if (const auto added = added_.find(from); added != added_.end()) {
    for (const std::string& words : std::vector(added->second)) add(session, words);
  } else if (const auto earlier = by_session_.find(from); earlier != by_session_.end()) {
    add(session, earlier->second.words);  // of an earlier run: what was added is not told apart
  }
}

void Objections::remove(const std::string& first_session) {
  const auto is_of = [&](const auto& one) { return name_of_xrays(one.first) == first_session; };
  std::erase_if(by_session_, is_of);
  std::erase_if(added_, is_of);
  for (auto& [patient_id, patient] : patients_) std::erase_if(patient.results, is_of);
}

void Objections::see(const std::string& patient_id, const StudyFiles& files) {
  OfPatient& patient = patients_[patient_id];
  for (const auto* images : {&files.images, &files.other_xrays})
    for (const StudyFiles::Image& image : *images) {
      const auto known = patient_of_uid_.find(image.sop_instance_uid);
      if (known != patient_of_uid_.end() && known->second != patient_id) {
        OfPatient same = std::exchange(patients_[known->second], {});
        for (const auto& [session, own] : same.results)
          for (const auto& [uid, acquired] : own) patient_of_uid_[uid] = patient_id;
        patient.results.merge(same.results);
        patient.regrouped.merge(same.regrouped);
        patient.xrays.merge(same.xrays);
      }
      patient.xrays[Xray(image.sop_instance_uid, image.acquired)] = {
          .label = image.label,
          .moment = {.at_s = image.at_s, .local_s = seconds_at(image.acquired), .has_utc_offset = image.has_utc_offset},
          .image = image,
          .is_rt_image = images == &files.images};
    }
}

std::set<std::string> Objections::sessions_of(
    const std::function<bool(const std::string& patient_id)>& is_asked_for) const {
  std::set<std::string> sessions;
  for (const auto& [patient_id, patient] : patients_)
    if (is_asked_for(patient_id))
      for (const auto& [session, own] : patient.results) sessions.insert(session);
  return sessions;
}

void Objections::update(const std::map<std::string, Patient>& patients, const std::set<std::string>& registered) {
  for (const auto& [patient_id, arrived] : patients) {
    OfPatient& patient = patients_[patient_id];
    if (patient.looked_at == arrived.last) continue;
    patient.looked_at = arrived.last;
    patient.is_news = true;
    see(patient_id, arrived.files);
  }
  for (auto& [patient_id, patient] : patients_) {
    if (!std::exchange(patient.is_news, false)) continue;
    for (const auto& [session, own] : patient.results) {
      Objection found = objection(patient, session, registered);
      if (const auto added = added_.find(session); added != added_.end())
        for (const std::string& words : added->second)
          if (found.words.find(words) == std::string::npos) add_words(words, found);
      const auto earlier = by_session_.find(session);
      const bool is_final =  // of an earlier run, which has seen more
          earlier != by_session_.end() && !earlier->second.newer_have_results && !are_seen(patient, own);
      if (!found.words.empty() && !is_final) by_session_[session] = std::move(found);
    }
  }
}

bool Objections::are_seen(const OfPatient& patient, const std::set<Xray>& own) {
  return std::ranges::all_of(own, [&](const Xray& xray) { return patient.xrays.at(xray).image.has_value(); });
}

// Whether it shows another patient, who has the same PatientID from another issuer.
bool Objections::is_of_other_issuer(const OfPatient& patient, const std::set<Xray>& own, const Seen& other) {
  return other.image && std::ranges::any_of(own, [&](const Xray& xray) {
           const auto& image = patient.xrays.at(xray).image;
           return image && !may_be_of_one_issuer(image->patient, other.image->patient);
         });
}

// True as well if it is not known, or if clock and offset from UTC contradict each other.
bool Objections::may_be_later(const Moment& moment, const Moment& than) {
  const bool is_later_by_clock = !moment.local_s || !than.local_s || *moment.local_s > *than.local_s;
  if (!moment.has_utc_offset || !than.has_utc_offset) return is_later_by_clock;
  if (!moment.at_s || !than.at_s) return true;
  if (*moment.has_utc_offset != *than.has_utc_offset) return *moment.at_s > *than.at_s - StudyFiles::kLargestUtcOffsetS;
  return *moment.at_s > *than.at_s || is_later_by_clock;
}

Objection Objections::newer_xrays(const OfPatient& patient, const std::set<Xray>& own,
                                  const std::set<std::string>& registered) {
  Moment latest_own = patient.xrays.at(*own.begin()).moment;
  for (const Xray& xray : own)
    if (const Moment& moment = patient.xrays.at(xray).moment; may_be_later(moment, latest_own)) latest_own = moment;
  const std::pair<const Xray, Seen>* newest = nullptr;
  bool have_results = true;
  for (const auto& one : patient.xrays) {
    if (own.contains(one.first) || is_of_other_issuer(patient, own, one.second) ||
        !may_be_later(one.second.moment, latest_own))
      continue;
    if (newest == nullptr || may_be_later(one.second.moment, newest->second.moment)) newest = &one;
    have_results = have_results && registered.contains(one.first.first);
  }
  if (newest == nullptr) return {};
  const std::string& acquired = newest->first.second;
  const std::string label = newest->second.label.empty() ? "an X-ray" : newest->second.label;
  return {.words = acquired.empty()
                       ? fmt::format("the patient has other X-rays, which may be newer: {} of an unknown time", label)
                       : fmt::format("the patient has newer X-rays: {} {}", label, acquired),
          .newer_have_results = have_results && !acquired.empty()};
}

// Results that share X-rays answer the same question, and at most one of them can be right.
std::string Objections::shared_xrays(const OfPatient& patient, const std::string& session) {
  std::set<std::string> own;
  for (const auto& [uid, acquired] : patient.results.at(session)) own.insert(uid);
  for (const auto& [other, xrays] : patient.results)
    if (name_of_xrays(other) != name_of_xrays(session) &&
        std::ranges::any_of(xrays, [&](const Xray& xray) { return own.contains(xray.first); }))
      return fmt::format("session {} has a result of some of these X-rays with others", other);
  return "";
}

// Of X-rays that a person has grouped, what is said in the report of their result is no news.
Objection Objections::objection(const OfPatient& patient, const std::string& session,
                                const std::set<std::string>& registered) const {
  const std::set<Xray>& own = patient.results.at(session);
  Objection found = newer_xrays(patient, own, registered);
  add_words(shared_xrays(patient, session), found);
  if (!are_seen(patient, own)) return found;
  StudyFiles all;
  for (const auto& [xray, seen] : patient.xrays)
    if (seen.image && !is_of_other_issuer(patient, own, seen))
      (seen.is_rt_image ? all.images : all.other_xrays).push_back(*seen.image);
  std::set<std::string> uids;
  for (const auto& [uid, acquired] : own) uids.insert(uid);
  const auto regrouped = patient.regrouped.find(session);
  if (regrouped == patient.regrouped.end()) {
    add_words(objection_to(uids, all, takes_other_xrays_, registered), found);
    return found;
  }
  SessionFiles group;
  for (const Xray& xray : own) group.images.push_back(*patient.xrays.at(xray).image);
  std::ranges::sort(group.images, {}, [](const auto& image) { return std::tuple(image.at_s, image.file); });
  group.patient = group.images.front().patient;
  for (const std::string& doubt : doubts_about(group, all, takes_other_xrays_, registered))
    if (std::ranges::none_of(regrouped->second,
                             [&](const std::string& reason) { return reason.find(doubt) != std::string::npos; })) {
      add_words(doubt, found);
      break;
    }
  return found;
}

}  // namespace isoshift
