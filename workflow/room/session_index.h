#pragma once
// The pages that list the sessions of a results tree: index.html with the sessions that wait and the newest sessions,
// and a page per month with all sessions of that month.

#include <map>
#include <set>
#include <string>
#include <vector>

#include "setup/setup_result.h"
#include "workflow/room/results_tree.h"
#include "workflow/room/session_list.h"
#include "workflow/room/waiting_session.h"

namespace isoshift {

class SessionIndex {
 public:
  SessionIndex(const ResultsTree& tree, std::string site) : tree_(tree), site_(std::move(site)), list_(tree) {}

  // `obstacle`: why the session cannot be released; `reason_for_person`: why the site's rule does not release it.
  // Either is empty if nothing is in the way.
  void add(const std::string& session, const SetupResult& report, const std::string& obstacle,
           const std::string& reason_for_person = "");
  // All results of these X-rays.
  void remove(const std::string& first_session);
  std::size_t size() const { return list_.sessions().size(); }

  // Finds out which sessions have been released and sent, and writes the pages that have changed. `troubles`: the
  // current troubles, such as a full disk. `objections`: what other X-rays say against results, by session.
  void update(const std::vector<WaitingSession>& waiting, const std::vector<std::string>& troubles,
              const std::map<std::string, Objection>& objections);

 private:
  void write(const std::string& page, const std::string& html);
  void remove_pages_but(const std::set<std::string>& pages);

  const ResultsTree& tree_;
  std::string site_;
  SessionList list_;
  std::vector<WaitingSession> waiting_;
  std::vector<std::string> troubles_;
  bool is_written_ = false;
  std::map<std::string, std::string> written_;  // SHA-256 of the written pages, by page
};

}  // namespace isoshift
