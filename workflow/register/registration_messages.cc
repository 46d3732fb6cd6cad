#include "workflow/register/registration_messages.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>

#include "base/error.h"
#include "base/json_file.h"
#include "base/message.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

constexpr const char* kText = "a text";
constexpr const char* kTexts = "a list of texts";
constexpr const char* kYesOrNo = "true or false";

RawText raw(const fs::path& path) { return {path.string()}; }
RawText raw(const std::string& text) { return {text}; }

template <class T>
std::vector<RawText> raw(const std::vector<T>& texts) {
  std::vector<RawText> all;
  all.reserve(texts.size());
  for (const T& text : texts) all.push_back(raw(text));
  return all;
}

template <class T>
std::vector<T> texts_in(JsonSection& section, const char* key) {
  std::vector<T> texts;
  for (RawText& text : section.required<std::vector<RawText>>(key, kTexts)) texts.emplace_back(std::move(text.bytes));
  return texts;
}

std::string text_in(JsonSection& section, const char* key) { return section.required<RawText>(key, kText).bytes; }

Verdict verdict_in(JsonSection& section) {
  const std::string word = section.required<std::string>("verdict", "a verdict");
  for (const Verdict verdict : {Verdict::kAccepted, Verdict::kReview, Verdict::kRejected})
    if (to_string(verdict) == word) return verdict;
  section.refuse("verdict", "a verdict");
}

struct ToJson {
  nlohmann::json operator()(const Ready&) const { return {{"ready", nlohmann::json::object()}}; }
  nlohmann::json operator()(const Progressed& progressed) const {
    return {{"progressed", {{"step", raw(progressed.step)}, {"share", progressed.share}}}};
  }
  nlohmann::json operator()(const Ended& ended) const {
    return {{"ended", {{"verdict", to_string(ended.verdict)}, {"files", ended.files}}}};
  }
  nlohmann::json operator()(const Failed& failed) const {
    return {{"failed", {{"why", raw(failed.why)}, {"is_of_disk", failed.is_of_disk}}}};
  }
};

}  // namespace

std::string to_line(const RegistrationOrder& order) {
  const StudyParts& parts = order.parts;
  return line_of({{"register",
                   {{"study", raw(parts.study)},
                    {"ct", raw(parts.ct)},
                    {"images", raw(parts.images)},
                    {"plan", raw(parts.plan)},
                    {"structures", raw(parts.structures)},
                    {"rival_structures", raw(parts.unused_structures.rivals)},
                    {"unusable_structures", raw(parts.unused_structures.unusable)},
                    {"doubts", raw(parts.doubts)},
                    {"flags", raw(order.flags)},
                    {"site", raw(order.site)},
                    {"anatomy", raw(order.anatomy)},
                    {"start", raw(order.start)},
                    {"is_searched", order.is_searched},
                    {"output", raw(order.output)},
                    {"tells_progress", order.tells_progress},
                    {"at_a_time", order.at_a_time},
                    {"worker", order.worker}}}});
}

std::string to_line(const RegistrationMessage& message) { return line_of(std::visit(ToJson(), message)); }

RegistrationOrder registration_order_from(const std::string& line, const std::string& name) {
  const nlohmann::json json = json_from(line, name);
  JsonSection message(json, name);
  std::optional<JsonSection> section = message.section("register");
  if (!section) message.refuse_missing("register", "an order");
  message.end();
  RegistrationOrder order{
      .parts = {.study = text_in(*section, "study"),
                .ct = texts_in<fs::path>(*section, "ct"),
                .images = texts_in<fs::path>(*section, "images"),
                .plan = text_in(*section, "plan"),
                .structures = text_in(*section, "structures"),
                .unused_structures = {.rivals = texts_in<fs::path>(*section, "rival_structures"),
                                      .unusable = texts_in<fs::path>(*section, "unusable_structures")},
                .doubts = texts_in<std::string>(*section, "doubts")},
      .flags = texts_in<std::string>(*section, "flags"),
      .site = text_in(*section, "site"),
      .anatomy = text_in(*section, "anatomy"),
      .start = text_in(*section, "start"),
      .is_searched = section->required<bool>("is_searched", kYesOrNo),
      .output = text_in(*section, "output"),
      .tells_progress = section->required<bool>("tells_progress", kYesOrNo),
      .at_a_time = section->required<int>("at_a_time", "a number of registrations"),
      .worker = section->required<int>("worker", "a number of a child")};
  if (order.at_a_time < 1) section->refuse("at_a_time", "at least 1");
  if (order.worker < 0) section->refuse("worker", "at least 0");
  section->end();
  return order;
}

RegistrationMessage registration_message_from(const std::string& line, const std::string& name) {
  const nlohmann::json json = json_from(line, name);
  JsonSection message(json, name);
  std::optional<JsonSection> ready = message.section("ready"), progressed = message.section("progressed"),
                             ended = message.section("ended"), failed = message.section("failed");
  message.end();
  if (json.size() != 1) throw Error(fmt::format("{}: expected ready, progressed, ended or failed", message.where()));
  JsonSection& section = ready ? *ready : progressed ? *progressed : ended ? *ended : *failed;
  RegistrationMessage result = Ready();
  if (progressed)
    result = Progressed{.step = text_in(section, "step"), .share = section.required<double>("share", "a share")};
  if (ended) {
    const Verdict verdict = verdict_in(section);
    result = Ended{.verdict = verdict,
                   .files = section.required<std::map<std::string, std::string>>("files", "the SHA-256 of every file")};
  }
  if (failed)
    result = Failed{.why = text_in(section, "why"), .is_of_disk = section.required<bool>("is_of_disk", kYesOrNo)};
  section.end();
  return result;
}

}  // namespace isoshift
