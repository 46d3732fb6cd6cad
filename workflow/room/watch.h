#pragma once
// A treatment room: what comes is registered, the results are held until they are released, what is released is sent.

#include <chrono>
#include <functional>
#include <map>
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
#include "workflow/room/deliver.h"
#include "workflow/room/results_tree.h"
#include "workflow/room/runner.h"
#include "workflow/room/sender.h"
#include "workflow/room/session_index.h"
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
    Observer& sending;               // is told by deliver()
    bool takes_other_xrays = false;  // a machine profile supplies the geometry of X-rays that are no RT Images
  };

  // Goes on from what is in the results tree. Throws Error where another watch works there.
  Watch(const WatchFile& watch, const Parts& parts);

  // Takes what has come, ends and begins registrations, releases what needs no person, and writes the pages. Waits for
  // nobody, and throws nothing that may be over in the next round.
  void round();

  // Sends what is released and due. May run in a thread of its own beside round().
  void deliver(const std::stop_token& stop);

  // Rounds, and deliveries in a thread, until the end is asked for. Then gives up the registration under way.
  void run(const std::function<bool()>& is_end_asked_for);

 private:
  struct Running {
    std::string session;
    Clock::Time news;  // of the patient, when it began
  };
  struct Failure {
    std::string why;
    Clock::Time news;              // of the patient, when it began
    std::optional<Backoff> again;  // unset: when there is news
  };
  struct Complete {
    SessionFiles session;
    StudyFiles files;
    Clock::Time last;
  };

  void take_results();
  Verdict take_result(const std::string& session);
  std::string obstacle_to_release(const std::string& session) const;
  void receive();
  void register_complete();
  std::vector<Complete> complete_sessions();
  std::string reason_to_wait(const SessionFiles& session, const StudyFiles& own, const std::string& patient_id,
                             Clock::Time last);
  void begin_registration(const Complete& complete);
  void end_registration();
  void fail(const std::string& session, Clock::Time news, const Runner::Failure& failure);
  void release_automatically();

  const WatchFile& watch_;
  Parts parts_;
  ResultsTree tree_;
  FileLock lock_;
  SessionIndex index_;
  Deliverer deliverer_;
  std::set<std::string> registered_;  // SOPInstanceUIDs of X-rays that have a result
  std::set<std::string> accepted_;    // sessions to be released without a person
  std::vector<WaitingSession> waiting_;
  std::optional<Running> running_;
  std::map<std::string, Failure> failures_;  // by session
  Troubles troubles_, sending_troubles_;
  Clock::Time seen_at_;     // what had come by then has been seen
  Clock::Time quiet_from_;  // the source could not be asked until then
  Clock::Time next_forgetting_;
  const SystemUser user_ = system_user();
};

}  // namespace isoshift
