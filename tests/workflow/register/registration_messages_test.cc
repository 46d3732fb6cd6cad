#include "workflow/register/registration_messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/message_line.h"

namespace isoshift::registration_messages_test {
namespace {

using testing::HasSubstr;

std::string error_of(const std::string& line) {
  try {
    (void)registration_message_from(line, "a worker");
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(RegistrationMessages, OrdersComeBackAsTheyWere) {
  const RegistrationOrder full{
      .parts = {.study = "/in/study",
                .ct = {"/in/CT, planning", "/in/M\xFCller\n"},
                .images = {"/in/AP;1", "/in/M\xC3\xBCller \"x\""},
                .plan = "/in/RTPLAN.dcm",
                .structures = "/in/RTSTRUCT.dcm",
                .unused_structures = {.rivals = {"/in/a.dcm", "/in/b.dcm"}, .unusable = {"/in/points.dcm"}}},
      .flags = {"--preset=fast", "--allow=gaps=it's \xE4lter"},
      .site = "/etc/site.json",
      .anatomy = "head",
      .start = "/in/pose.json",
      .is_searched = false,
      .output = "/out/a",
      .tells_progress = true,
      .at_a_time = 4,
      .worker = 3};
  EXPECT_EQ(registration_order_from(line_without_end(to_line(full)), ""), full);
  EXPECT_EQ(registration_order_from(line_without_end(to_line(RegistrationOrder())), ""), RegistrationOrder());
}

TEST(RegistrationMessages, AnswersComeBackAsTheyWere) {
  for (const RegistrationMessage& message :
       {RegistrationMessage(Ready()), RegistrationMessage(Progressed{.step = "Registering", .share = 0.25}),
        RegistrationMessage(Ended{.verdict = Verdict::kAccepted, .files = {{"result.json", "12ab"}}}),
        RegistrationMessage(Ended{.verdict = Verdict::kReview}),
        RegistrationMessage(Ended{.verdict = Verdict::kRejected}),
        RegistrationMessage(Failed{.why = "no CT\n       Name \xFC"}),
        RegistrationMessage(Failed{.why = "disk full", .is_of_disk = true})})
    EXPECT_EQ(registration_message_from(line_without_end(to_line(message)), ""), message) << to_line(message);
}

TEST(RegistrationMessages, DamagedAndUnknownOnesAreErrorsThatNameTheSender) {
  EXPECT_THAT(error_of("ready"), HasSubstr("a worker: is not JSON"));
  EXPECT_THAT(error_of("{\"ended\":{\"verd"), HasSubstr("a worker: is not JSON"));
  EXPECT_EQ(error_of("3"), "a worker: expected an object");
  EXPECT_EQ(error_of("{}"), "a worker: expected ready, progressed, ended or failed");
  EXPECT_EQ(error_of("{\"ready\":{},\"ended\":{}}"), "a worker: expected ready, progressed, ended or failed");
  EXPECT_EQ(error_of("{\"begun\":{}}"),
            "a worker: there is no key begun; the keys are ready, progressed, ended, failed");
  EXPECT_EQ(error_of("{\"ready\":true}"), "a worker: ready: expected an object");
  EXPECT_EQ(error_of("{\"ended\":{}}"), "a worker: ended: verdict is missing, expected a verdict");
  EXPECT_EQ(error_of("{\"ended\":{\"verdict\":\"fine\"}}"), "a worker: ended: verdict is \"fine\", expected a verdict");
  EXPECT_EQ(error_of("{\"ended\":{\"verdict\":\"review\"}}"),
            "a worker: ended: files is missing, expected the SHA-256 of every file");
  EXPECT_THAT(error_of("{\"failed\":{\"why\":\"x\"}}"), HasSubstr("failed: is_of_disk is missing"));
  EXPECT_THAT(error_of("{\"failed\":{\"why\":\"x\",\"is_of_disk\":false,\"again\":1}}"),
              HasSubstr("failed: there is no key again"));
}

TEST(RegistrationMessages, DamagedOrdersAreErrors) {
  const auto error_of_order = [](const std::string& line) -> std::string {
    try {
      (void)registration_order_from(line, "the parent");
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_EQ(error_of_order("{}"), "the parent: register is missing, expected an order");
  EXPECT_EQ(error_of_order("{\"register\":{}}"), "the parent: register: study is missing, expected a text");
  RegistrationOrder none;
  none.at_a_time = 0;
  EXPECT_THAT(error_of_order(to_line(none)), HasSubstr("at_a_time is 0, expected at least 1"));
}

}  // namespace
}  // namespace isoshift::registration_messages_test
