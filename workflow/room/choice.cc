#include "workflow/room/choice.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <set>
#include <tuple>

#include "io/config/site_file.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

Json json_of(const std::vector<Candidate>& candidates) {
  Json json = Json::array();
  for (const Candidate& candidate : candidates) json.push_back(isoshift::json_of(candidate));
  return json;
}

}  // namespace

std::string in_words(const Choice& choice) {
  std::vector<std::string> xrays, chosen;
  for (const Candidate& xray : choice.xrays) xrays.push_back(xray.words);
  for (const Candidate& one : {choice.patient, choice.plan, choice.ct})
    if (!one.id.empty()) chosen.push_back(one.words);
  const std::string of_xrays = fmt::format("{}", fmt::join(xrays, " and "));
  if (choice.is_withdrawn)
    return fmt::format("{} withdrew on {} the choice for {} ({})", choice.by, choice.on, of_xrays, choice.reason);
  if (choice.is_regrouped) chosen.insert(chosen.begin(), "that they show one setup");
  if (chosen.empty()) chosen.emplace_back("as the files tell");
  return fmt::format("{} chose on {} for {}: {} ({})", choice.by, choice.on, of_xrays, fmt::join(chosen, ", "),
                     choice.reason);
}

Json json_of(const Candidate& candidate) { return {{"id", candidate.id}, {"words", candidate.words}}; }

Json json_of(const Choice& choice) {
  return {{"schema", 1},
          {"session", choice.session},
          {"xrays", json_of(choice.xrays)},
          {"patient", json_of(choice.patient)},
          {"plan", json_of(choice.plan)},
          {"ct", json_of(choice.ct)},
          {"offered", choice.offered},
          {"is_regrouped", choice.is_regrouped},
          {"is_withdrawn", choice.is_withdrawn},
          {"patient_id", choice.patient_id},
          {"reason", choice.reason},
          {"by", choice.by},
          {"user", choice.user},
          {"on", choice.on}};
}

Candidate candidate_from(const nlohmann::json& json) { return {.id = json.at("id"), .words = json.at("words")}; }

std::vector<Candidate> candidates_from(const nlohmann::json& json) {
  std::vector<Candidate> candidates;
  for (const nlohmann::json& one : json) candidates.push_back(candidate_from(one));
  return candidates;
}

Choice choice_from(const nlohmann::json& json) {
  return {.session = json.at("session"),
          .xrays = candidates_from(json.at("xrays")),
          .patient = candidate_from(json.at("patient")),
          .plan = candidate_from(json.at("plan")),
          .ct = candidate_from(json.at("ct")),
          .offered = json.value("offered", std::set<std::string>()),  // older choices have none
          .is_regrouped = json.at("is_regrouped"),
          .is_withdrawn = json.at("is_withdrawn"),
          .patient_id = json.at("patient_id"),
          .reason = json.at("reason"),
          .by = json.at("by"),
          .user = json.at("user"),
          .on = json.at("on")};
}

std::optional<SessionFiles> chosen_session(const Choice& choice, const StudyFiles& files, bool other_xrays,
                                           const std::set<std::string>& registered) {
  std::set<std::string> left;  // a copy of an X-ray counts once
  for (const Candidate& xray : choice.xrays) left.insert(xray.id);
  SessionFiles session{
      .name = choice.session, .patient = {}, .images = {}, .remarks = {}, .doubts = {in_words(choice)}};
  const auto take = [&](const std::vector<StudyFiles::Image>& images) {
    std::ranges::copy_if(images, std::back_inserter(session.images),
                         [&](const StudyFiles::Image& image) { return left.erase(image.sop_instance_uid) > 0; });
  };
  take(files.images);
  if (other_xrays) take(files.other_xrays);
  if (!left.empty() || session.images.empty()) return std::nullopt;
  std::ranges::sort(session.images, {}, [](const auto& image) { return std::tuple(image.at_s, image.file); });
  session.patient = choice.patient.id.empty() ? session.images.front().patient : choice.patient.id;
  std::ranges::move(doubts_about(session, files, other_xrays, registered), std::back_inserter(session.doubts));
  return session;
}

StudyFiles as_chosen(StudyFiles of_session, const Choice& choice) {
  if (!choice.plan.id.empty())
    std::erase_if(of_session.plans, [&](const auto& plan) { return plan.sop_instance_uid != choice.plan.id; });
  if (!choice.ct.id.empty())
    std::erase_if(of_session.cts, [&](const auto& ct) { return ct.series_instance_uid != choice.ct.id; });
  return of_session;
}

std::string missing_of(const Choice& choice, const StudyFiles& as_chosen) {
  if (!choice.plan.id.empty() && as_chosen.plans.empty()) return choice.plan.words;
  if (!choice.ct.id.empty() && as_chosen.cts.empty()) return choice.ct.words;
  return "";
}

std::vector<std::string> flags_for(const Choice& choice, const SessionFiles& session) {
  double span_s = 0.0;
  for (const StudyFiles::Image& image : session.images)
    for (const StudyFiles::Image& other : session.images)
      if (image.at_s && other.at_s) span_s = std::max(span_s, *image.at_s - *other.at_s);
  if (span_s <= kMaxTimeSpanS) return {};
  return {"--allow", fmt::format("time-span={}", in_words(choice))};
}

}  // namespace isoshift
