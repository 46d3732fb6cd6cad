// A full day of a treatment room, in seconds.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "io/study/session_files.h"
#include "tests/support/treatment_room.h"
#include "workflow/room/results_tree.h"
#include "workflow/room/watch.h"

namespace isoshift::watch_day_test {
namespace {

using namespace std::chrono_literals;

constexpr int kPatients = 30, kSessions = 3;
constexpr double kLongestDelayS = 120.0;

struct Arrival {
  double second = 0.0;  // of the day
  StudyFiles object;
};

struct Day {
  std::vector<Arrival> arrivals;                 // by time
  std::set<std::set<std::string>> sessions;      // their X-rays
  std::set<std::set<std::string>> under_review;  // the verdict of these is "review"
};

// Every patient has three sessions, 15 minutes apart. Objects come in any order within two minutes, every tenth twice.
Day a_day(std::mt19937& random) {
  Day day;
  const auto share = [&] { return std::uniform_real_distribution<>()(random); };
  const auto bring = [&](const StudyFiles& object, double second) {
    day.arrivals.push_back({second + kLongestDelayS * share(), object});
    if (share() < 0.1) day.arrivals.push_back({second + kLongestDelayS * share(), object});
  };
  for (int n = 0; n < kPatients; ++n) {
    const std::string patient = fmt::format("P{}", n);
    const double begin = second_of(8, 0) + 8 * 3600.0 * share();
    bring(ct_of(patient), begin);
    bring(plan_of(patient), begin);
    for (int session = 0; session < kSessions; ++session) {
      const double second = begin + 900.0 * session;
      const std::string first = fmt::format("{}.{}.1", patient, session),
                        other = fmt::format("{}.{}.2", patient, session);
      bring(xray(patient, first, "AP", second), second);
      bring(xray(patient, other, "LAT", second + 10.0), second + 10.0);
      day.sessions.insert({first, other});
      if (session == 1) day.under_review.insert({first, other});
    }
  }
  std::ranges::sort(day.arrivals, {}, &Arrival::second);
  return day;
}

std::multiset<std::string> registered(const TreatmentRoom& room) {
  std::multiset<std::string> sessions;
  std::ifstream audit(room.file.results / "audit.jsonl");
  for (std::string line; std::getline(audit, line);)
    if (const auto json = nlohmann::json::parse(line); json["event"] == "registered") sessions.insert(json["session"]);
  return sessions;
}

TEST(WatchDay, EverySessionIsRegisteredOnceAndEveryReleaseSentOnceToEveryPeer) {
  std::mt19937 random(1);
  const Day day = a_day(random);
  TreatmentRoom room;
  room.file.site.automatic_release = {.by = "J. Doe", .on = "2026-03-01"};
  room.runner.length = 20s;
  room.runner.verdict = [&](const auto& xrays) {
    return day.under_review.contains(xrays) ? Verdict::kReview : Verdict::kAccepted;
  };
  room.sender.loses_answer = [&] { return random() % 20 == 0; };
  room.start();
  auto next = day.arrivals.begin();
  bool was_restarted = false;
  for (double second = second_of(8, 0); second < second_of(18, 0); second += 10.0) {
    for (; next != day.arrivals.end() && next->second <= second; ++next) room.source.bring(next->object);
    room.pass(10s, 10s);
    const bool is_restarted_now = !was_restarted && second > second_of(12, 0) && room.runner.is_running();
    if (is_restarted_now) room.start();
    was_restarted |= is_restarted_now;
  }
  ASSERT_TRUE(was_restarted);

  // A person releases what nobody else may.
  ResultsTree tree(room.file.results);
  std::multiset<std::string> expected;
  std::map<std::string, int> stored;
  for (const auto& xrays : day.sessions) {
    const std::string name = session_name(xrays);
    expected.insert(name);
    const bool is_under_review = day.under_review.contains(xrays);
    EXPECT_EQ(tree.is_released(name), !is_under_review) << name;
    if (is_under_review)
      tree.release(name, {.by = "J. Doe", .user = "", .sudo_user = "", .despite_objection = true},
                   room.file.names_of_peers());
    for (const std::string& peer : room.file.names_of_peers()) {
      stored[fmt::format("{} {}/report.dcm", peer, name)] = 1;
      if (!is_under_review) stored[fmt::format("{} {}/spatial_registration.dcm", peer, name)] = 1;
    }
  }
  room.pass(1800s, 10s);
  EXPECT_EQ(registered(room), expected);
  EXPECT_EQ(room.sender.stored(), stored);
  EXPECT_THAT(room.index(), testing::HasSubstr(fmt::format("{} sessions registered, 0 waiting", day.sessions.size())));
  for (const auto& xrays : room.runs()) EXPECT_TRUE(day.sessions.contains(xrays)) << testing::PrintToString(xrays);
  EXPECT_EQ(room.runs().size(), day.sessions.size() + 1);  // the registration that the restart gave up
}

}  // namespace
}  // namespace isoshift::watch_day_test
