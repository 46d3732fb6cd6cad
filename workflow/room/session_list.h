#pragma once
// The sessions of a results tree that have a result, and what became of them.

#include <map>
#include <string>
#include <vector>

#include "io/study/study_files.h"
#include "setup/setup_result.h"
#include "workflow/room/results_tree.h"

namespace isoshift {

struct ListedSession {
  std::string name, patient, verdict, action;
  std::string patient_key;  // as patient_key()
  std::string held;         // in words: the state before it is released
  std::string state;  // in words: "held", "released by J. Doe on ...; 1 to be sent", "held; superseded by session ..."
  std::string first;  // when the first X-ray was acquired, "2026-03-01 10:15:00"
  std::string times;  // of all X-rays
  std::string release;   // in words: the part of the state that tells of the release
  bool is_over = false;  // that part cannot change any more

  bool operator==(const ListedSession&) const = default;
};

// Labels and times of the X-rays of a session: "KV_AP 2026-03-01 10:15:00; KV_LAT 2026-03-01 10:15:10".
std::string times_of(const std::vector<StudyFiles::Image>& images);
std::string times_of(const std::vector<SetupResult::View>& views);

class SessionList {
 public:
  explicit SessionList(const ResultsTree& tree) : tree_(&tree) {}

  // `obstacle`: why the session cannot be released; `reason_for_person`: why the site's rule does not release it.
  // Either is empty if nothing is in the way.
  void add(const std::string& session, const SetupResult& report, const std::string& obstacle,
           const std::string& reason_for_person = "");

  // Takes all results of these X-rays out. Returns whether there were any.
  bool remove(const std::string& first_session);

  // Finds out which sessions have been released and sent. Returns whether the state of any has changed. `objections`:
  // what other X-rays say against results, by session.
  bool update(const std::map<std::string, Objection>& objections);

  const std::vector<ListedSession>& sessions() const { return sessions_; }  // the newest first

 private:
  std::string since_then(const std::string& session) const;
  std::string release_of(const ListedSession& session, const Objection& objection, bool& is_over) const;

  const ResultsTree* tree_;  // never null
  std::vector<ListedSession> sessions_;
};

// Why a result cannot be released: it has no valid record of its registration. Empty: it has.
std::string obstacle_to_release(const ResultsTree& tree, const std::string& session, Verdict verdict);

}  // namespace isoshift
