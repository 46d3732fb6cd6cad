#pragma once
// The pages that list the sessions of a results tree: index.html with what waits and the newest, and a page per month
// with all of it.

#include <map>
#include <string>
#include <vector>

#include "io/study/study_files.h"
#include "setup/setup_result.h"
#include "workflow/room/results_tree.h"

namespace isoshift {

// "KV_AP 2026-03-01 10:15:00; KV_LAT 2026-03-01 10:15:10", of the X-rays of a session.
std::string times_of(const std::vector<StudyFiles::Image>& images);

// X-rays without a result, and why.
struct WaitingSession {
  std::string name, patient_id, acquired, why;
  bool has_failed = false;
  bool operator==(const WaitingSession&) const = default;
};

class SessionIndex {
 public:
  SessionIndex(const ResultsTree& tree, std::string site) : tree_(tree), site_(std::move(site)) {}

  // `obstacle`: why the session cannot be released; empty: it can be.
  void add(const std::string& session, const SetupResult& report, const std::string& obstacle);
  std::size_t size() const { return sessions_.size(); }

  // Looks what has been released and sent, and writes the pages that are no longer true. `troubles`: what does not work
  // now.
  void update(const std::vector<WaitingSession>& waiting, const std::vector<std::string>& troubles);

 private:
  struct Session {
    std::string name, patient, verdict, action;
    std::string held;  // the state before it is released
    std::string state;
    std::string first;     // when the first X-ray was acquired, "2026-03-01 10:15:00"
    std::string times;     // of all X-rays
    bool is_over = false;  // nothing becomes of it any more
  };
  bool update_states();
  void write(const std::string& page, const std::string& html);

  const ResultsTree& tree_;
  std::string site_;
  std::vector<Session> sessions_;  // the newest first
  std::vector<WaitingSession> waiting_;
  std::vector<std::string> troubles_;
  bool is_written_ = false;
  std::map<std::string, std::string> written_;  // SHA-256 of pages
};

}  // namespace isoshift
