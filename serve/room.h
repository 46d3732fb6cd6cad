#pragma once
// What the screen shows of a results tree, and what people do there. The engine, isoshift room watch, is another
// process.

#include <Eigen/Geometry>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/system_user.h"
#include "io/config/watch_file.h"
#include "workflow/room/clock.h"
#include "workflow/room/engine_state.h"
#include "workflow/room/results_tree.h"
#include "workflow/room/session_list.h"
#include "workflow/room/trend.h"

namespace isoshift {

// What was asked for is not there.
class NotThere : public Error {
 public:
  using Error::Error;
};

// May be called from several threads.
class Room {
 public:
  // Throws Error if the results tree cannot be made or read.
  Room(const WatchFile& watch, const Clock& clock);

  // The sessions with their states, what waits, troubles, and whether the engine runs, as JSON; at most half a second
  // old. `version` changes whenever the list does.
  struct Seen {
    std::string version;
    nlohmann::ordered_json list;
    bool does_engine_run = false;
  };
  std::shared_ptr<const Seen> seen();

  // A session for the screen, as JSON: also what speaks against its release, and `record`, the SHA-256 of the record of
  // its registration. Throws NotThere.
  nlohmann::ordered_json session(const std::string& name);

  // All results of the session's patient, the oldest first, as JSON. Throws NotThere.
  nlohmann::ordered_json trend(const std::string& session);

  // A file of the session, as it was registered. Throws NotThere, and Error if it was changed.
  std::string file(const std::string& session, const std::string& name);

  // Throws Error, and releases nothing, where ResultsTree::release() does.
  void release(const std::string& session, const ResultsTree::Seen& seen, const std::string& user,
               bool despite_objection);

  // Records what a user has decided. Throws Error where ResultsTree::decide() does.
  void decide(const Decision& decision);

  // What a user may choose for a session that waits, as JSON. Throws NotThere.
  nlohmann::ordered_json options(const std::string& session);
  // Records what a user has chosen for it, and returns the name of the session that the engine will make of the X-rays.
  // Throws Error for what is not among the options, and where ResultsTree::choose() does.
  std::string choose(const std::string& session, const ChosenIds& ids, const std::string& reason,
                     const std::string& user);
  // Records that a user withdraws the choice that stands for it. Throws Error if there is none.
  void withdraw_choice(const std::string& session, const std::string& reason, const std::string& user);
  // Whether the session is still in the list; at most half a second old.
  bool is_there(const std::string& session);

  // What a person who registers a session by hand begins with: how its X-rays are registered, the setup error of their
  // newest result, and the folder for results. Throws NotThere, and Error if nobody kept how.
  ManualBasis manual_basis(const std::string& session);
  Eigen::Isometry3d setup_error(const std::string& session);
  std::filesystem::path by_hand(const std::string& session) const;
  // Hands a finished result to the engine, and returns the name of the session that the engine will make of it. Throws
  // Error where ResultsTree::hand_over() does.
  std::string hand_over(const ManualBasis& basis, const MadeResult& result, const std::string& user);

  // A line in the audit log: that a user has signed in or looked at a session. If it cannot be written now, it is kept:
  // on a full disk people must see reports all the same.
  void audit(const std::string& event, const std::string& user, const std::string& session = "");

 private:
  void look();
  void look_for_sessions(std::vector<std::string>& troubles);
  std::string registered_content(const std::string& session, const std::string& name) const;
  const ListedSession& listed(const std::string& session) const;
  WaitingSession waiting(const std::string& session) const;
  bool can_choose(const std::string& session) const;

  const WatchFile& watch_;
  const Clock& clock_;
  const SystemUser user_ = system_user();
  std::mutex mutex_;
  ResultsTree tree_;
  SessionList list_;
  using RegisteredAt = std::optional<std::filesystem::file_time_type>;
  std::map<std::string, RegisteredAt> known_;  // sessions in the list
  std::shared_ptr<const Seen> seen_;
  Clock::Time seen_at_;
};

}  // namespace isoshift
