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

// Whether both may show one setup: nothing but the time between them tells that they do not. An X-ray without an issuer
// may be of any.
bool may_belong_together(const StudyFiles::Image& a, const StudyFiles::Image& b) {
  return may_be_of_one_issuer(a.patient, b.patient) &&
         std::tie(a.plan_uid, a.machine) == std::tie(b.plan_uid, b.machine) &&
         (!a.at_s || !b.at_s || std::abs(*a.at_s - *b.at_s) <= kDayS);
}

std::vector<Candidate> other_xrays_of(const SessionFiles& session, const StudyFiles& files, bool takes_other_xrays,
                                      const SessionOfXray& session_of) {
  std::vector<Candidate> others;
  const auto is_among = [](const auto& list, const std::string& uid, auto member) {
    return std::ranges::find(list, uid, member) != list.end();
  };
  const auto add = [&](const std::vector<StudyFiles::Image>& images) {
    for (const StudyFiles::Image& image : images) {
      const std::string& uid = image.sop_instance_uid;
      const auto registered = session_of.find(uid);
      const bool is_deleted = registered != session_of.end() && registered->second.empty();
      if (is_deleted || is_among(session.images, uid, &StudyFiles::Image::sop_instance_uid) ||
          is_among(others, uid, &Candidate::id) || !may_belong_together(session.images.front(), image))
        continue;
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
  const std::string& of_xrays = session.images.front().patient;
  const std::string id = patient_id_of(of_xrays);
  if (of_xrays != id + "\\") return {};
  std::set<std::string> patients;
  const auto add = [&](const auto& entries) {
    for (const auto& entry : entries)
      if (entry.patient != of_xrays && patient_id_of(entry.patient) == id) patients.insert(entry.patient);
  };
  add(files.cts);
  add(files.plans);
  add(files.structures);
  if (patients.size() < 2) return {};
  std::vector<Candidate> candidates;
  candidates.reserve(patients.size());
  for (const std::string& patient : patients)
    candidates.push_back({patient, fmt::format("the patient ID of the issuer {}", patient.substr(id.size() + 1))});
  return candidates;
}

// None where the X-rays name their plan.
std::vector<Candidate> plans_of(const StudyFiles& own) {
  const bool is_named =
      std::ranges::any_of(own.images, [](const StudyFiles::Image& image) { return !image.plan_uid.empty(); });
  if (is_named || own.plans.size() < 2) return {};
  std::vector<Candidate> candidates;
  candidates.reserve(own.plans.size());
  for (const StudyFiles::Plan& plan : own.plans)
    candidates.push_back(
        {plan.sop_instance_uid, fmt::format("the RT Plan {} ({})", plan.label, plan.file.filename().string())});
  return candidates;
}

std::vector<Candidate> cts_of(const StudyFiles& own) {
  if (own.cts.size() < 2) return {};
  std::vector<Candidate> candidates;
  candidates.reserve(own.cts.size());
  for (const StudyFiles::Ct& ct : own.cts)
    candidates.push_back({ct.series_instance_uid, fmt::format("the CT {} ({} images, {})", ct.label, ct.files.size(),
                                                              ct.files.front().filename().string())});
  return candidates;
}

// Adds the end of its UID to every one that reads like another.
void tell_apart(std::vector<Candidate>& candidates) {
  constexpr std::size_t kEnd = 12;
  std::map<std::string, int> counts;
  for (const Candidate& candidate : candidates) ++counts[candidate.words];
  for (Candidate& candidate : candidates)
    if (counts[candidate.words] > 1)
      candidate.words +=
          fmt::format(", UID ...{}", candidate.id.substr(candidate.id.size() - std::min(kEnd, candidate.id.size())));
}

// So that a person sees what was chosen, and can choose something else, where it has gone.
void add_chosen(std::vector<Candidate>& candidates, const Candidate& chosen) {
  if (!chosen.id.empty() && std::ranges::find(candidates, chosen.id, &Candidate::id) == candidates.end())
    candidates.push_back(chosen);
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
                          bool takes_other_xrays, const SessionOfXray& session_of, const Choice* standing) {
  SessionOptions options{.own_xrays = {},
                         .other_xrays = other_xrays_of(session, files, takes_other_xrays, session_of),
                         .patients = patients_of(session, files),
                         .plans = plans_of(own),
                         .cts = cts_of(own),
                         .chosen = std::nullopt};
  for (const StudyFiles::Image& image : session.images)
    options.own_xrays.push_back({image.sop_instance_uid, words_of(image)});
  for (auto* candidates : {&options.own_xrays, &options.other_xrays, &options.plans, &options.cts})
    tell_apart(*candidates);
  if (standing == nullptr) return options;
  add_chosen(options.patients, standing->patient);
  add_chosen(options.plans, standing->plan);
  add_chosen(options.cts, standing->ct);
  options.chosen =
      ChosenIds{.xrays = {}, .patient = standing->patient.id, .plan = standing->plan.id, .ct = standing->ct.id};
  for (const Candidate& xray : standing->xrays) options.chosen->xrays.insert(xray.id);
  options.is_regrouped = standing->is_regrouped;
  return options;
}

Json json_of(const SessionOptions& options) {
  const auto list = [](const std::vector<Candidate>& candidates) {
    Json json = Json::array();
    for (const Candidate& candidate : candidates) json.push_back(json_of(candidate));
    return json;
  };
  Json chosen = nullptr;
  if (options.chosen)
    chosen = {{"xrays", options.chosen->xrays},
              {"patient", options.chosen->patient},
              {"plan", options.chosen->plan},
              {"ct", options.chosen->ct}};
  return {{"own_xrays", list(options.own_xrays)},
          {"other_xrays", list(options.other_xrays)},
          {"patients", list(options.patients)},
          {"plans", list(options.plans)},
          {"cts", list(options.cts)},
          {"chosen", std::move(chosen)},
          {"is_regrouped", options.is_regrouped}};
}

SessionOptions session_options_from(const nlohmann::json& json) {
  SessionOptions options{.own_xrays = candidates_from(json.at("own_xrays")),
                         .other_xrays = candidates_from(json.at("other_xrays")),
                         .patients = candidates_from(json.at("patients")),
                         .plans = candidates_from(json.at("plans")),
                         .cts = candidates_from(json.at("cts")),
                         .chosen = std::nullopt,
                         .is_regrouped = json.at("is_regrouped")};
  if (const nlohmann::json& chosen = json.at("chosen"); !chosen.is_null())
    options.chosen = ChosenIds{
        .xrays = chosen.at("xrays"), .patient = chosen.at("patient"), .plan = chosen.at("plan"), .ct = chosen.at("ct")};
  return options;
}

Choice chosen_from(const SessionOptions& options, const ChosenIds& ids) {
  std::set<std::string> own;
  for (const Candidate& xray : options.own_xrays) own.insert(xray.id);
  const bool is_regrouped = ids.xrays != own;
  if (std::ranges::none_of(ids.xrays, [&](const std::string& uid) { return own.contains(uid); }))
    throw Error("none of the chosen X-rays is of this session");
  if (!is_regrouped && !options.chosen && ids.patient.empty() && ids.plan.empty() && ids.ct.empty())
    throw Error("nothing was chosen");
  std::vector<Candidate> all = options.own_xrays;
  std::ranges::copy(options.other_xrays, std::back_inserter(all));
  Choice choice;
  choice.session = session_name(ids.xrays);
  for (const std::string& uid : ids.xrays) choice.xrays.push_back(found(all, uid));
  choice.patient = found(options.patients, ids.patient);
  choice.plan = found(options.plans, ids.plan);
  choice.ct = found(options.cts, ids.ct);
  for (const auto* candidates : {&options.plans, &options.cts})
    for (const Candidate& candidate : *candidates) choice.offered.insert(candidate.id);
  choice.is_regrouped = is_regrouped || options.is_regrouped;
  return choice;
}

}  // namespace isoshift
