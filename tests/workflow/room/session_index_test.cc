#include "workflow/room/session_index.h"
#include "tests/support/findings.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "base/output_folder.h"
#include "tests/support/registered_session.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::session_index_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class SessionIndexTest : public testing::Test {
 protected:
  void add(const std::string& session, const std::string& acquired, Verdict verdict = Verdict::kAccepted,
           const std::string& obstacle = "") {
    SetupResult report;
    report.findings = findings_for(verdict);
    report.identity.patient_name = "Doe^Jane";
    report.identity.patient_id = "7";
    report.views.emplace_back().acquired = acquired;
    index_.add(session, report, obstacle);
  }
  std::string page(const std::string& name) const {
    std::ifstream file(tree_.path() / name);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  TemporaryFolder folder_;
  ResultsTree tree_{folder_ / "results"};
  SessionIndex index_{tree_, "Site"};
};

TEST_F(SessionIndexTest, ListsWhatWaitsAndTheNewestFirst) {
  add("old", "2026-02-27 10:15:00");
  add("new", "2026-03-01 10:15:00");
  index_.update({{.name = "next", .patient_id = "8", .why = "1 of 2 X-rays"}}, {"receiving: no answer"}, {});
  const std::string index = page("index.html");
  EXPECT_THAT(index, HasSubstr("1 of 2 X-rays"));
  EXPECT_THAT(index, HasSubstr("receiving: no answer"));
  EXPECT_LT(index.find("sessions/new/"), index.find("sessions/old/"));
  EXPECT_THAT(index, HasSubstr("sessions-2026-02.html"));
  EXPECT_THAT(page("sessions-2026-02.html"), HasSubstr("sessions/old/"));
  EXPECT_THAT(page("sessions-2026-02.html"), Not(HasSubstr("sessions/new/")));
}

TEST_F(SessionIndexTest, ShowsTheTimeOfEveryXray) {
  SetupResult report;
  report.views = {{.label = "AP", .acquired = "2026-03-01 10:15:00"}, {.label = "LAT", .acquired = ""}};
  index_.add("a", report, "");
  StudyFiles::Image waiting{.label = "", .acquired = "2026-03-01 10:20:10"};
  index_.update({{.name = "next", .patient_id = "8", .acquired = times_of({waiting}), .why = "1 of 2 X-rays"}}, {}, {});
  const std::string index = page("index.html");
  EXPECT_THAT(index, HasSubstr("AP 2026-03-01 10:15:00; LAT at an unknown time"));
  EXPECT_THAT(index, HasSubstr("X-ray 2026-03-01 10:20:10"));
}

TEST_F(SessionIndexTest, ADateThatIsNoneHasAPageToo) {
  add("a", "2026/3/1");
  index_.update({}, {}, {});
  EXPECT_THAT(page("index.html"), HasSubstr("sessions-undated.html"));
  EXPECT_THAT(page("sessions-undated.html"), HasSubstr("sessions/a/"));
}

TEST_F(SessionIndexTest, TellsWhatBecomesOfASession) {
  const std::string a = register_session(tree_, {"1.2.1"}, "review");
  add(a, "2026-03-01 10:15:00", Verdict::kReview);
  add("r", "2026-03-01 10:15:00", Verdict::kRejected);
  add("u", "2026-03-01 10:15:00", Verdict::kAccepted, "there is no record");
  index_.update({}, {}, {});
  EXPECT_THAT(page("index.html"), HasSubstr("<td>held</td>"));
  EXPECT_THAT(page("index.html"), HasSubstr("<td>held, cannot be released: there is no record</td>"));
  EXPECT_THAT(page("index.html"), HasSubstr("<td>rejected</td></tr>"));
  tree_.release(a, {.by = "J. Doe", .user = "isoshift", .sudo_user = "doe"}, {"record"});
  index_.update({}, {}, {});
  EXPECT_THAT(page("index.html"), HasSubstr("released by J. Doe (user isoshift, sudo of doe) on "));
  EXPECT_THAT(page("index.html"), HasSubstr("; 1 to be sent"));
  for (const Delivery& delivery : tree_.pending().deliveries) {
    tree_.prepare_to_send(delivery);
    tree_.mark_sent(delivery, "");
  }
  index_.update({}, {}, {});
  EXPECT_THAT(page("index.html"), HasSubstr("; sent</td>"));
  EXPECT_THAT(page("sessions-2026-03.html"), HasSubstr("; sent</td>"));
}

TEST_F(SessionIndexTest, OneReleaseThatCannotBeReadHidesNoSession) {
  add("a", "2026-03-01 10:15:00");
  add("b", "2026-03-01 10:15:00");
  write_text(tree_.path() / "released" / "a.json", "{");
  index_.update({}, {}, {});
  EXPECT_THAT(page("index.html"), HasSubstr("a.json: is not JSON"));
  EXPECT_THAT(page("index.html"), HasSubstr("sessions/b/"));
}

TEST_F(SessionIndexTest, AHandWrittenReleaseIsTold) {
  add("a", "2026-03-01 10:15:00");
  write_text(tree_.path() / "released" / "a.json", "{}");
  index_.update({}, {}, {});
  EXPECT_THAT(page("index.html"), HasSubstr("a.json: is not the newest release of session"));
}

TEST_F(SessionIndexTest, AYearOfSessionsIsNotInOnePage) {
  for (int n = 0; n < 700; ++n) add(fmt::format("s{}", n), fmt::format("2026-{:02}-01 10:15:00", 1 + n % 12));
  index_.update({}, {}, {});
  const std::string index = page("index.html");
  std::size_t rows = 0;
  for (std::size_t at = 0; (at = index.find("<tr class=", at)) != std::string::npos; ++at) ++rows;
  EXPECT_EQ(rows, 500U);
  EXPECT_THAT(index, HasSubstr("700 sessions registered"));
  EXPECT_THAT(page("sessions-2026-01.html"), HasSubstr("sessions/s0/"));
}

}  // namespace
}  // namespace isoshift::session_index_test
