#pragma once
// Which results are out of date: the patient has newer X-rays, which may show that the couch has moved.

#include <map>
#include <string>
#include <vector>

#include "workflow/room/waiting_session.h"

namespace isoshift {

class NewestXrays {
 public:
  // `last`: when the session's last X-ray was acquired, "2026-03-01 10:15:00"; empty: unknown.
  void add_result(const std::string& session, const std::string& patient_id, const std::string& last);
  // The sessions without a result.
  void set_waiting(const std::vector<WaitingSession>& waiting);

  // The newest session of the same patient with X-rays that were acquired after those of `session`; empty: none. An
  // X-ray without a result whose time is unknown counts as newer.
  std::string newer_than(const std::string& session) const;

 private:
  struct Xrays {
    std::string last, session;
    auto operator<=>(const Xrays&) const = default;
  };
  struct Result {
    std::string patient_id, last;
  };
  std::map<std::string, Result> results_;               // by session
  std::map<std::string, Xrays> newest_result_, waits_;  // the newest, by PatientID
};

}  // namespace isoshift
