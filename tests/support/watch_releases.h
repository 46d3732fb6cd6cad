#pragma once
// A treatment room with patients of one session each, and what becomes of their results.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "base/error.h"
#include "io/study/session_files.h"
#include "tests/support/treatment_room.h"
#include "workflow/room/results_tree.h"
#include "workflow/room/watch.h"

namespace isoshift {

// Sessions of patients, each with the X-rays PATIENT1 and PATIENT2.
class WatchReleases : public testing::Test {
 protected:
  void allow_automatic_release() { room_.file.site.automatic_release = {.by = "J. Doe", .on = "2026-03-01"}; }
  void bring(const std::string& patient) {
    room_.source.bring(ct_of(patient));
    room_.source.bring(plan_of(patient));
    room_.source.bring(xray(patient, patient + "1", "AP", second_of(10, 15)));
    room_.source.bring(xray(patient, patient + "2", "LAT", second_of(10, 15, 10)));
  }
  // An X-ray taken between the two, after which these belong together no longer.
  void bring_one_between(const std::string& patient) {
    room_.source.bring(xray(patient, patient + "3", "AP", second_of(10, 15, 5)));
  }
  // The room opens, and the patient's session is registered.
  void register_first(const std::string& patient) {
    room_.start();
    bring(patient);
    room_.pass(std::chrono::seconds(60));
  }
  // Slices of the CT that come after the others.
  void bring_late_slice(const std::string& patient) {
    StudyFiles late = ct_of(patient);
    late.cts[0].files = {"/in/late"};
    late.cts[0].sop_instance_uids = {"late"};
    room_.source.bring(late);
  }
  static std::string session(const std::string& patient) { return session_name({patient + "1", patient + "2"}); }
  void release(const std::string& patient) {
    ResultsTree(room_.file.results)
        .release(session(patient), {.by = "J. Doe", .user = "isoshift", .sudo_user = ""}, room_.file.names_of_peers());
  }
  // P's result is released, and no peer answers.
  void release_while_peers_are_down() {
    register_first("P");
    room_.sender.down = {"record", "archive"};
    release("P");
  }
  std::string error_of_release(const std::string& patient) {
    try {
      release(patient);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  std::string audit() const {
    std::ifstream file(room_.file.results / "audit.jsonl");
    return {std::istreambuf_iterator<char>(file), {}};
  }
  bool is_released(const std::string& patient) const {
    return ResultsTree(room_.file.results).is_released(session(patient));
  }
  // What speaks against the result of a session.
  std::string objection(const std::string& session) const {
    return ResultsTree(room_.file.results).objection(session).words;
  }
  auto objects(const std::string& peer, const std::string& patient) const {
    const std::string key = fmt::format("{} {}/", peer, session(patient));
    return std::pair(testing::Pair(key + "spatial_registration.dcm", 1), testing::Pair(key + "report.dcm", 1));
  }
  // When a peer was tried, after the first time.
  std::vector<std::chrono::seconds> attempts(const std::string& peer) const {
    std::vector<Clock::Time> times;
    for (const FakeSender::Attempt& attempt : room_.sender.attempts())
      if (attempt.peer == peer) times.push_back(attempt.at);
    std::vector<std::chrono::seconds> after;
    for (const Clock::Time time : times)
      after.push_back(std::chrono::duration_cast<std::chrono::seconds>(time - times.front()));
    return after;
  }

  TreatmentRoom room_;
};

}  // namespace isoshift
