#include "workflow/room/audit_message.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/command.h"
#include "tests/support/results_tree.h"

namespace isoshift::audit_message_test {
namespace {

using Json = nlohmann::ordered_json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

const AuditContext kContext{.site = "Linac <3>",
                            .identity = {.patient_id = "7",
                                         .patient_id_issuer = "St. \"E\"",
                                         .patient_name = "Doe^Jane",
                                         .study_instance_uid = "1.2.3"},
                            .called_aet = "RECORD",
                            .host = "10.0.0.5"};

std::string message(const Json& line) { return audit_message(line, kContext).value_or("none"); }

TEST(AuditMessageTest, SaysWhoLookedAtWhat) {
  EXPECT_EQ(
      message({{"on", "2026-03-01T10:20:00+0100"}, {"event", "viewed"}, {"by", "jdoe"}, {"session", "a"}}),
      R"(<?xml version="1.0" encoding="UTF-8"?><AuditMessage>)"
      R"(<EventIdentification EventActionCode="R" EventDateTime="2026-03-01T10:20:00+01:00" EventOutcomeIndicator="0">)"
      R"(<EventID csd-code="110103" codeSystemName="DCM" originalText="DICOM Instances Accessed"/></EventIdentification>)"
      R"(<ActiveParticipant UserID="jdoe" UserIsRequestor="true"></ActiveParticipant>)"
      R"(<ActiveParticipant UserID="isoshift" UserIsRequestor="false">)"
      R"(<RoleIDCode csd-code="110150" codeSystemName="DCM" originalText="Application"/></ActiveParticipant>)"
      R"(<AuditSourceIdentification AuditSourceID="Linac &lt;3>"><AuditSourceTypeCode csd-code="4"/></AuditSourceIdentification>)"
      R"(<ParticipantObjectIdentification ParticipantObjectID="1.2.3" ParticipantObjectTypeCode="2" ParticipantObjectTypeCodeRole="3">)"
      R"(<ParticipantObjectIDTypeCode csd-code="110180" codeSystemName="DCM" originalText="Study Instance UID"/>)"
      R"(</ParticipantObjectIdentification>)"
      R"x(<ParticipantObjectIdentification ParticipantObjectID="7 (St. &quot;E&quot;)" ParticipantObjectTypeCode="1" ParticipantObjectTypeCodeRole="1">)x"
      R"(<ParticipantObjectIDTypeCode csd-code="2" codeSystemName="RFC-3881" originalText="Patient Number"/>)"
      R"(</ParticipantObjectIdentification></AuditMessage>)");
}

TEST(AuditMessageTest, EveryEventThatTheStandardDefinesHasItsCode) {
  EXPECT_THAT(message({{"event", "started"}, {"sessions", 3}}),
              AllOf(HasSubstr(R"(csd-code="110100")"), HasSubstr(R"(EventTypeCode csd-code="110120")"),
                    HasSubstr(R"(UserID="isoshift" UserIsRequestor="true")"), Not(HasSubstr("ParticipantObject"))));
  EXPECT_THAT(message({{"event", "stopped"}}), HasSubstr(R"(EventTypeCode csd-code="110121")"));
  EXPECT_THAT(message({{"event", "sign-in refused"}, {"by", "x"}}),
              AllOf(HasSubstr(R"(csd-code="110114")"), HasSubstr(R"(EventOutcomeIndicator="4")")));
  EXPECT_THAT(message({{"event", "deleted"}, {"by", "x"}, {"session", "a"}}), HasSubstr(R"(EventActionCode="D")"));
  EXPECT_THAT(message({{"event", "sent"}, {"session", "a"}, {"peer", "record"}}),
              AllOf(HasSubstr(R"(csd-code="110104")"), HasSubstr(R"(csd-code="110153")"),
                    HasSubstr(R"(UserID="RECORD" UserIsRequestor="false" NetworkAccessPointID="10.0.0.5")")));
  for (const char* event : {"released", "decided", "objection", "registered"})
    EXPECT_EQ(message({{"event", event}, {"session", "a"}}), "none");
  EXPECT_THAT(message({{"event", "viewed"}, {"by", "x"}, {"session", "a"}}), Not(HasSubstr("Doe")));
}

class AuditMirror : public ResultsTreeTest {};

TEST_F(AuditMirror, HearsOfEveryLineThatWasWritten) {
  AuditLog log(tree_.path() / "other.jsonl");
  std::vector<std::string> heard;
  log.set_mirror([&](const Json& line) { heard.push_back(line.at("event")); });
  log.append("a", Json::object());
  log.note("b", Json::object());
  EXPECT_EQ(heard, (std::vector<std::string>{"a", "b"}));
}

}  // namespace
}  // namespace isoshift::audit_message_test
