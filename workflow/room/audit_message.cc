#include "workflow/room/audit_message.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "workflow/room/audit_chain.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

struct Code {
  const char* value;
  const char* meaning;
};
constexpr Code kApplicationActivity{"110100", "Application Activity"}, kStart{"110120", "Application Start"},
    kStop{"110121", "Application Stop"}, kAccessed{"110103", "DICOM Instances Accessed"},
    kTransferred{"110104", "DICOM Instances Transferred"}, kAuthentication{"110114", "User Authentication"},
    kLogin{"110122", "Login"}, kApplication{"110150", "Application"}, kDestination{"110152", "Destination Role ID"},
    kSource{"110153", "Source Role ID"}, kStudyUid{"110180", "Study Instance UID"};

struct Event {
  const char* name;  // in the log
  Code id;
  std::optional<Code> type;
  char action;
  int outcome;  // 0: success, 4: minor failure
};
constexpr std::array kEvents = {
    Event{"started", kApplicationActivity, kStart, 'E', 0}, Event{"stopped", kApplicationActivity, kStop, 'E', 0},
    Event{"viewed", kAccessed, std::nullopt, 'R', 0},       Event{"opened by hand", kAccessed, std::nullopt, 'R', 0},
    Event{"deleted", kAccessed, std::nullopt, 'D', 0},      Event{"sent", kTransferred, std::nullopt, 'C', 0},
    Event{"signed in", kAuthentication, kLogin, 'E', 0},    Event{"sign-in refused", kAuthentication, kLogin, 'E', 4}};

std::string attribute(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '&')
      escaped += "&amp;";
    else if (c == '<')
      escaped += "&lt;";
    else if (c == '"')
      escaped += "&quot;";
    else if (static_cast<unsigned char>(c) >= ' ')
      escaped += c;
  }
  return '"' + escaped + '"';
}

std::string code(const char* element, const Code& code) {
  return fmt::format(R"(<{} csd-code="{}" codeSystemName="DCM" originalText="{}"/>)", element, code.value,
                     code.meaning);
}

std::string participant(const std::string& user, bool is_requestor, const std::optional<Code>& role,
                        const std::string& more = "") {
  return fmt::format(R"(<ActiveParticipant UserID={} UserIsRequestor="{}"{}>{}</ActiveParticipant>)", attribute(user),
                     is_requestor, more, role ? code("RoleIDCode", *role) : "");
}

const Event* event_of(const Json& line) { return std::ranges::find(kEvents, text_in(line, "event"), &Event::name); }

std::string participants(const Event& event, const Json& line, const AuditContext& context) {
  constexpr const char* kProgram = "isoshift";
  const std::string person = text_in(line, "by");
  std::string text;
  if (!person.empty()) text += participant(person, true, std::nullopt);
  if (std::string_view(event.name) == "sent") {
    constexpr const char* kByName = R"( NetworkAccessPointID={} NetworkAccessPointTypeCode="1")";
    text += participant(kProgram, person.empty(), kSource);
    text += participant(context.called_aet, false, kDestination, fmt::format(kByName, attribute(context.host)));
  } else {
    text += participant(kProgram, person.empty(), kApplication);
  }
  return text;
}

std::string objects(const AuditContext& context) {
  constexpr const char* kObject =
      R"(<ParticipantObjectIdentification ParticipantObjectID={} ParticipantObjectTypeCode="{}" ParticipantObjectTypeCodeRole="{}">{}</ParticipantObjectIdentification>)";
  return fmt::format(kObject, attribute(context.identity.study_instance_uid), 2, 3,
                     code("ParticipantObjectIDTypeCode", kStudyUid)) +
         fmt::format(
             kObject, attribute(patient_in_words(context.identity)), 1, 1,
             R"(<ParticipantObjectIDTypeCode csd-code="2" codeSystemName="RFC-3881" originalText="Patient Number"/>)");
}

// "2026-03-01T10:20:00+0100" with the colon of RFC 3339.
std::string date_time(std::string on) {
  constexpr std::size_t kMinutes = 2;
  if (const std::size_t sign = on.find_last_of("+-"); sign != std::string::npos && sign + 5 == on.size())
    on.insert(on.size() - kMinutes, ":");
  return on;
}

}  // namespace

bool has_audit_message(const Json& line) { return event_of(line) != kEvents.end(); }

std::optional<std::string> audit_message(const Json& line, const AuditContext& context) {
  const auto* event = event_of(line);
  if (event == kEvents.end()) return std::nullopt;
  std::string text = fmt::format(
      R"(<?xml version="1.0" encoding="UTF-8"?><AuditMessage><EventIdentification EventActionCode="{}" EventDateTime={} EventOutcomeIndicator="{}">)",
      event->action, attribute(date_time(text_in(line, "on"))), event->outcome);
  text += code("EventID", event->id) + (event->type ? code("EventTypeCode", *event->type) : "");
  text += "</EventIdentification>" + participants(*event, line, context);
  text += fmt::format(
      R"(<AuditSourceIdentification AuditSourceID={}><AuditSourceTypeCode csd-code="4"/></AuditSourceIdentification>)",
      attribute(context.site));
  if (!text_in(line, "session").empty()) text += objects(context);
  return text + "</AuditMessage>";
}

}  // namespace isoshift
