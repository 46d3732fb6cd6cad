#include "workflow/room/session_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <tuple>

#include "base/error.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kDayS = 24.0 * 3600.0;

std::string words_of(const StudyFiles::Image& image) {
  return fmt::format("{} {}", image.label.empty() ? "X-ray" : image.label,
                     image.acquired.empty() ? "of an unknown time" : image.acquired);
}

// Whether both may show one setup: nothing but the time between them tells that they do not.
bool may_belong_together(const StudyFiles::Image& a, const StudyFiles::Image& b) {
  return std::tie(a.plan_uid, a.machine) == std::tie(b.plan_uid, b.machine) &&
         (!a.at_s || !b.at_s || std::abs(*a.at_s - *b.at_s) <= kDayS);
}

std::vector<Candidate> other_xrays_of(const SessionFiles& session, const StudyFiles& files, bool takes_other_xrays,
                                      const std::map<std::string, std::string>& session_of) {
  std::vector<Candidate> others;
  const auto is_among = [](const auto& list, const std::string& uid, auto member) {
    return std::ranges::find(list, uid, member) != list.end();
  };
  const auto add = [&](const std::vector<StudyFiles::Image>& images) {
    for (const StudyFiles::Image& image : images) {
      const std::string& uid = image.sop_instance_uid;
      if (is_among(session.images, uid, &StudyFiles::Image::sop_instance_uid) ||
          is_among(others, uid, &Candidate::id) || !may_belong_together(session.images.front(), image))
        continue;
      const auto registered = session_of.find(uid);
      others.push_back(
          {uid, words_of(image) +
                    (registered == session_of.end() ? "" : fmt::format(" of session {}", registered->second))});
    }
  };
  add(files.images);
  if (takes_other_xrays) add(files.other_xrays);
  return others;
}

// The issuers among whom X-rays without an issuer may be.
std::vector<Candidate> patients_of(const SessionFiles& session, const StudyFiles& files) {
  const std::string id = patient_id_of(session.patient);
  if (session.patient != id + "\\") return {};
  std::set<std::string> patients;
  const auto add = [&](const auto& entries) {
    for (const auto& entry : entries)
      if (entry.patient != session.patient && patient_id_of(entry.patient) == id) patients.insert(entry.patient);
  };
  add(files.cts);
  add(files.plans);
  add(files.structures);
  if (patients.size() < 2) return {};
  std::vector<Candidate> candidates;
  for (const std::string& patient : patients)
    candidates.push_back({patient, fmt::format("the patient ID of the issuer {}", patient.substr(id.size() + 1))});
  return candidates;
}

std::vector<Candidate> plans_of(const StudyFiles& own) {
  const auto is_named = [&](const StudyFiles::Plan& plan) {
    return std::ranges::find(own.images, plan.sop_instance_uid, &StudyFiles::Image::plan_uid) != own.images.end();
  };
  if (own.plans.size() < 2 || std::ranges::count_if(own.plans, is_named) == 1) return {};
  std::vector<Candidate> candidates;
  for (const StudyFiles::Plan& plan : own.plans)
    candidates.push_back({plan.sop_instance_uid, fmt::format("the RT Plan {}", plan.label)});
  return candidates;
}

std::vector<Candidate> cts_of(const StudyFiles& own) {
  if (own.cts.size() < 2) return {};
  std::vector<Candidate> candidates;
  for (const StudyFiles::Ct& ct : own.cts)
    candidates.push_back({ct.series_instance_uid, fmt::format("the CT {} ({} images)", ct.label, ct.files.size())});
  return candidates;
}

// That of an ID; nothing for an empty one.
Candidate found(const std::vector<Candidate>& candidates, const std::string& id) {
  if (id.empty()) return {};
  const auto candidate = std::ranges::find(candidates, id, &Candidate::id);
  if (candidate == candidates.end()) throw Error("what was chosen is not there to be chosen any more. Choose again");
  return *candidate;
}

}  // namespace

SessionOptions options_of(const SessionFiles& session, const StudyFiles& own, const StudyFiles& files,
                          bool takes_other_xrays, const std::map<std::string, std::string>& session_of) {
  SessionOptions options{.own_xrays = {},
                         .other_xrays = other_xrays_of(session, files, takes_other_xrays, session_of),
                         .patients = patients_of(session, files),
                         .plans = plans_of(own),
                         .cts = cts_of(own)};
  for (const StudyFiles::Image& image : session.images)
    options.own_xrays.push_back({image.sop_instance_uid, words_of(image)});
  return options;
}

Json json_of(const SessionOptions& options) {
  const auto list = [](const std::vector<Candidate>& candidates) {
    Json json = Json::array();
    for (const Candidate& candidate : candidates) json.push_back(json_of(candidate));
    return json;
  };
  return {{"own_xrays", list(options.own_xrays)},
          {"other_xrays", list(options.other_xrays)},
          {"patients", list(options.patients)},
          {"plans", list(options.plans)},
          {"cts", list(options.cts)}};
}

SessionOptions session_options_from(const nlohmann::json& json) {
  return {.own_xrays = candidates_from(json.at("own_xrays")),
          .other_xrays = candidates_from(json.at("other_xrays")),
          .patients = candidates_from(json.at("patients")),
          .plans = candidates_from(json.at("plans")),
          .cts = candidates_from(json.at("cts"))};
}

Choice chosen_from(const SessionOptions& options, const ChosenIds& ids) {
  Choice choice{.session = session_name(ids.xrays),
                .xrays = {},
                .patient = found(options.patients, ids.patient),
                .plan = found(options.plans, ids.plan),
                .ct = found(options.cts, ids.ct),
                .reason = {},
                .by = {},
                .user = {},
                .on = {}};
  std::vector<Candidate> all = options.own_xrays;
  std::ranges::copy(options.other_xrays, std::back_inserter(all));
  for (const std::string& uid : ids.xrays) choice.xrays.push_back(found(all, uid));
  std::set<std::string> own;
  for (const Candidate& xray : options.own_xrays) own.insert(xray.id);
  if (ids.xrays.empty() || (ids.xrays == own && ids.patient.empty() && ids.plan.empty() && ids.ct.empty()))
    throw Error("nothing was chosen");
  return choice;
}

}  // namespace isoshift
