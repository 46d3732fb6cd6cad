#pragma once
// A treatment room: registers the sessions that arrive, holds the results until they are released, and sends released
// results.

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <vector>

#include "base/backoff.h"
#include "base/file_lock.h"
#include "base/system_user.h"
#include "io/config/watch_file.h"
#include "io/study/session_files.h"
#include "setup/verdict.h"
#include "workflow/observer.h"
#include "workflow/room/clock.h"
#include "workflow/room/clock_comparison.h"
#include "workflow/room/deliver.h"
#include "workflow/room/engine_state.h"
#include "workflow/room/grouping.h"
#include "workflow/room/input_changes.h"
#include "workflow/room/objections.h"
#include "workflow/room/results_tree.h"
#include "workflow/room/runner.h"
#include "workflow/room/sender.h"
#include "workflow/room/session_index.h"
#include "workflow/room/session_inputs.h"
#include "workflow/room/source.h"
#include "workflow/room/troubles.h"

namespace isoshift {

// A program calls run(). A test calls round() and deliver(), and is the clock, the source, the runner and the sender:
//
//   Watch watch(file, {.source = source, .runner = runner, .sender = sender, .clock = clock, ...});
//   source.bring(xray);
//   watch.round();
class Watch {
 public:
  struct Parts {
    Source& source;
    Runner& runner;
    Sender& sender;
    Clock& clock;
    Observer& observer;
    Observer& sending;               // receives the messages of deliver()
    const FileContents& contents;    // of the source's files
    bool takes_other_xrays = false;  // a machine profile supplies the geometry of X-rays that are not RT Images
  };

  // Continues from the files in the results tree. Throws Error if another watch uses that tree.
  Watch(const WatchFile& watch, const Parts& parts);

  // Takes new files, ends and begins registrations, releases results that need no person, and writes the pages. Never
  // waits. Does not throw for troubles that may be over in the next round. Throws Error if the file of its lock is
  // gone: another watch may use the tree.
  void round();

  // Sends the deliveries that are due. May run in its own thread beside round().
  void deliver(const std::stop_token& stop);

  // Calls round(), and deliver() in a thread, until the end is asked for. Then gives up the current registration.
  void run(const std::function<bool()>& is_end_asked_for);

 private:
  struct Running {
    std::string session;
    Clock::Time news;         // when the patient's last file had arrived, as the registration began
    std::string patient_id;   // in the source
    bool names_plan = false;  // all X-rays do
    SessionInputs inputs;
  };
  // What may be sent. Not known: the source does not answer, or its X-rays were not compared with the results yet.
  struct Sendable {
    bool is_known = false;
    std::set<std::string> released = {};  // sessions, before the source was read: a file may have come just before
    std::set<std::string> waiting = {};   // sessions that may not
  };
  struct Failure {
    std::string why;
    Clock::Time news;              // when the patient's last file had arrived, as the registration began
    std::optional<Backoff> again;  // unset: tried again only when another file of the patient arrives
  };
  struct Complete {
    SessionFiles session;
    StudyFiles files;
    Clock::Time last;
  };

  std::vector<std::string> troubles() const;  // also files that cannot be read
  void take_results();
  // `made`: unset for what an earlier run has registered.
  void take_result(const std::string& session, const std::optional<Running>& made = std::nullopt);
  std::string reason_for_person(const std::string& session, const SetupResult& result,
                                const std::optional<Running>& made) const;
  void take_over_results();
  void take_over(const std::string& session);
  void receive();
  void compare_clocks();
  void take_deletions();
  void take_choices();
  void read_choices(const std::map<std::string, std::string>& there);
  void delete_old_results();
  void register_complete();
  std::vector<Complete> complete_sessions();
  bool is_quiet(const std::string& patient_id, Clock::Time last) const;
  void look_for_changes();
  WaitingSession waiting(const SessionFiles& session, const StudyFiles& own, const std::string& patient_id,
                         const Patient& patient);
  std::string reason_to_wait(const SessionFiles& session, const StudyFiles& own, const std::string& patient_id,
                             Clock::Time last);
  void begin_registration(const Complete& complete);
  void end_registration();
  void fail(const std::string& session, Clock::Time news, const Runner::Failure& failure);
  void look_for_objections();
  bool may_have_news(const std::string& patient_id) const;
  void set_sendable(Sendable sendable);
  void release_automatically();
  void release_by_rule(const std::string& session);

  const WatchFile& watch_;
  Parts parts_;
  ResultsTree tree_;
  FileLock lock_;
  Objections objections_;
  std::map<std::string, Objection> kept_objections_;  // those on the disk
  SessionIndex index_;
  EngineFile engine_;
  Deliverer deliverer_;
  std::mutex sendable_mutex_;  // deliver() reads, round() writes
  Sendable sendable_;
  ClockComparison clocks_;
  Grouping grouping_;
  InputChanges changes_;
  std::optional<std::filesystem::file_time_type> deletions_read_;
  std::optional<std::map<std::string, std::string>> choices_read_;
  std::map<std::string, Choice> choices_;  // those that were read, also withdrawn ones
  std::string choice_trouble_;
  std::map<std::string, std::string> accepted_;  // released without a person: PatientID in the source, by session
  std::set<std::string> released_;               // sessions, as this round began
  bool is_source_read_ = false;                  // in this round
  bool was_source_read_ = false;                 // in the round before
  bool are_clocks_compared_ = false;
  std::vector<WaitingSession> waiting_, chosen_;
  std::optional<Running> running_;
  std::map<std::string, Failure> failures_;  // by session
  Troubles troubles_, sending_troubles_;
  Clock::Time seen_at_;     // all files that had arrived by then have been read
  Clock::Time quiet_from_;  // until then the source did not answer
  Clock::Time next_forgetting_, next_deletion_;
  const SystemUser user_ = system_user();
};

}  // namespace isoshift
