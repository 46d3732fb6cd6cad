// isoshift watch: registers what comes into a treatment room, and holds the results until they are released.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <regex>
#include <set>
#include <stop_token>
#include <thread>

#include "base/backoff.h"
#include "base/child_process.h"
#include "base/error.h"
#include "base/graceful_end.h"
#include "base/system_user.h"
#include "cli/commands/commands.h"
#include "cli/commands/register_command.h"
#include "cli/switches/registration_switches.h"
#include "cli/switches/study_switches.h"
#include "io/config/watch_file.h"
#include "io/report/result_folder.h"
#include "io/study/session_files.h"
#include "workflow/register/setup_result_of.h"
#include "workflow/room/deliver.h"
#include "workflow/room/inbox.h"
#include "workflow/room/results_tree.h"
#include "workflow/room/session_index.h"

namespace isoshift {
namespace {

using Clock = std::chrono::steady_clock;

// Flags of isoshift register that a watch file names must be some, and none of those that watch sets itself.
RegisterOptions checked_registration_flags(const WatchFile& watch) {
  CLI::App app;
  RegisterOptions options;
  add_result_options(app, options);
  add_study_switches(app, options.study);
  add_registration_switches(app, options.registration);
  const auto refuse = [&](const std::exception& error) {
    throw Error(fmt::format("{}: register: {}", watch.path.string(), error.what()));
  };
  try {
    app.parse(std::vector<std::string>(watch.registration.rbegin(), watch.registration.rend()));
    options.registration.settle();
    options.study.study = watch.results;  // any: its words are what is checked
    (void)options.study.request();
    if (!options.site.empty()) throw UsageError("--site is named by site, not here");
    (void)chosen_site(watch.site, options.anatomy);
  } catch (const CLI::ParseError& error) {
    refuse(error);
  } catch (const UsageError& error) {
    refuse(error);
  }
  return options;
}

class Watch {
 public:
  Watch(const WatchFile& watch, bool takes_other_xrays, Console& console)
      : watch_(watch),
        console_(console),
        tree_(watch.results),
        inbox_(watch, watch.results / "objects"),
        index_(tree_, watch.site.name),
        deliverer_(watch),
        takes_other_xrays_(takes_other_xrays) {}

  void run() {
    const auto lock = tree_.try_lock();
    if (!lock) throw Error(fmt::format("{}: another isoshift watch is working here", tree_.path().string()));
    const GracefulEnd end;
    std::signal(SIGPIPE, SIG_IGN);  // a peer or server that goes is told by what is called
    tree_.clean();
    take_results();
    attempt(troubles_, "completing the audit log", [&] { tree_.complete_audit(); });
    tree_.audit("started", {{"sessions", index_.size()}});
    console_.err << fmt::format("watching {}; results in {}\n",
                                watch_.orthanc ? watch_.orthanc->url : watch_.folder.string(), tree_.path().string());
    std::jthread sending([this](const std::stop_token& stop) { send(stop); });  // a peer may take its time
    while (!end.is_asked_for()) {
      attempt(troubles_, "receiving", [&] { receive(); });
      attempt(troubles_, "registering", [&] { register_complete(); });
      attempt(troubles_, "releasing", [&] { release_automatically(); });
      attempt(troubles_, "writing the audit log", [&] { tree_.write_kept_audit(); });
      attempt(troubles_, "writing the index", [&] { index_.update(waiting_, troubles()); });
      std::this_thread::sleep_for(kRound);
    }
    running_.reset();
    sending.request_stop();
    sending.join();
    tree_.audit("stopped", nlohmann::ordered_json::object());
  }

 private:
  struct Running {
    std::string session;
    Clock::time_point news;  // of the patient, when it began
    std::unique_ptr<Child> child;
  };
  struct Failure {
    std::string why;
    Clock::time_point news;        // of the patient, when it began
    std::optional<Backoff> again;  // unset: when there is news
  };
  struct Complete {
    SessionFiles session;
    StudyFiles files;
    Clock::time_point last;
  };
  static constexpr std::chrono::milliseconds kRound{500};
  static constexpr std::chrono::seconds kFirstPause{30}, kLongestPause{600};
  static constexpr std::chrono::days kKeptFor{60};  // objects of a patient of whom nothing comes any more

  // Nothing that fails now ends the watch: a full disk, a server that is down. Each kind of trouble is said once.
  using Troubles = std::map<std::string, std::string>;  // by what is tried
  void attempt(Troubles& troubles, const std::string& what, const std::function<void()>& work) const {
    try {
      work();
      if (troubles.erase(what) > 0) console_.err << what << ": goes on\n";
    } catch (const std::exception& error) {
      if (std::exchange(troubles[what], error.what()) != error.what())
        console_.err << fmt::format("{}: {}\n", what, error.what());
    }
  }

  std::vector<std::string> troubles() const {
    std::vector<std::string> lines;
    for (const auto& [what, why] : troubles_) lines.push_back(fmt::format("{}: {}", what, why));
    return lines;
  }

  void send(const std::stop_token& stop) {
    Troubles troubles;
    while (!stop.stop_requested()) {
      attempt(troubles, "sending", [&] { deliverer_.deliver(stop, sending_); });
      std::this_thread::sleep_for(kRound);
    }
  }

  // While a server is down nothing is known to be quiet.
  void receive() {
    const Clock::time_point begin = Clock::now();
    Notes notes;
    try {
      inbox_.update(notes);
    } catch (const std::exception&) {
      print_warnings(notes.warnings, console_);
      quiet_from_ = Clock::now();
      throw;
    }
    print_warnings(notes.warnings, console_);
    seen_at_ = begin;
    if (Clock::now() < next_forgetting_) return;
    inbox_.forget_before(std::filesystem::file_time_type::clock::now() - kKeptFor);
    next_forgetting_ = Clock::now() + std::chrono::days(1);
  }

  // One that cannot be read hides no other.
  void take_results() {
    const std::vector<std::string> sessions = tree_.sessions();
    ProgressBar progress(console_, "reading sessions");
    for (std::size_t n = 0; n < sessions.size(); ++n) {
      try {
        take_result(sessions[n]);
      } catch (const std::exception& error) {
        console_.err << fmt::format("warning: session {}: {}\n", sessions[n], error.what());
      }
      progress.update(n + 1, sessions.size());
    }
  }

  Verdict take_result(const std::string& name) {
    const SetupResult report = read_report(tree_.session(name));
    if (report.views.empty()) throw Error(fmt::format("{}: names no views", tree_.session(name).string()));
    for (const SetupResult::View& view : report.views) registered_.insert(view.sop_instance_uid);
    index_.add(name, report, obstacle_to_release(name));
    // What was made under another site file waits for a person.
    if (watch_.site.automatic_release && report.verdict == Verdict::kAccepted && report.site &&
        report.site->sha256 == watch_.site.sha256)
      accepted_.insert(name);
    return report.verdict;
  }

  // Empty: there is a record of its registration. What the folder holds is checked when it is released.
  std::string obstacle_to_release(const std::string& name) const {
    try {
      (void)tree_.registered(name);
      return "";
    } catch (const Error& error) {
      return error.what();
    }
  }

  // One at a time, those with the newest X-rays first: somebody waits for them.
  void register_complete() {
    if (running_) end_registration();
    waiting_.clear();
    std::vector<Complete> complete;
    std::set<std::string> found;
    for (const auto& [patient_id, patient] : inbox_.patients()) {
      for (SessionFiles& session : sessions_of(patient.files, takes_other_xrays_, registered_)) {
        found.insert(session.name);
        StudyFiles own = files_for(session, patient.files);
        const bool is_running = running_ && running_->session == session.name;
        std::string why = is_running ? "is being registered" : reason_to_wait(session, own, patient_id, patient.last);
        const bool is_complete = why.empty();
        if (is_complete) why = "has its turn soon";
        waiting_.push_back({.name = session.name,
                            .patient_id = patient_id,
                            .acquired = times_of(session.images),
                            .why = std::move(why),
                            .has_failed = failures_.contains(session.name)});
        if (is_complete) complete.push_back({std::move(session), std::move(own), patient.last});
      }
    }
    std::erase_if(failures_, [&](const auto& failure) { return !found.contains(failure.first); });
    if (running_ || complete.empty()) return;
    begin_registration(*std::ranges::min_element(complete, {}, [&](const Complete& one) {
      return std::pair(failures_.contains(one.session.name), -one.session.images.back().at_s.value_or(0.0));
    }));
  }

  // Empty: it can be registered now.
  std::string reason_to_wait(const SessionFiles& session, const StudyFiles& own, const std::string& patient_id,
                             Clock::time_point last) {
    const SiteFile::Sessions& rule = *watch_.site.sessions;
    if (static_cast<int>(session.images.size()) < rule.views)
      return fmt::format("{} of {} X-rays{}{}", session.images.size(), rule.views, session.remarks.empty() ? "" : "; ",
                         fmt::join(session.remarks, "; "));
    if (const auto missing = missing_parts(own); !missing.empty()) {
      inbox_.ask_for_rest(patient_id);
      return "waits for " + missing.front();
    }
    const std::chrono::duration<double> quiet = seen_at_ - std::max(last, quiet_from_);
    if (inbox_.is_coming(patient_id) || quiet.count() < rule.quiet_s) return "more may come";
    const auto failure = failures_.find(session.name);
    if (failure == failures_.end() || last != failure->second.news) return "";
    const auto& [why, news, again] = failure->second;
    return again && again->is_due() ? "" : why;
  }

  // In a process of its own, whatever it meets there.
  void begin_registration(const Complete& complete) {
    const std::string& session = complete.session.name;
    for (const std::string& remark : complete.session.remarks)
      console_.err << fmt::format("session {}: {}\n", session, remark);
    try {
      tree_.check_is_new(session);
      const StudyParts parts = choose_parts(complete.files);
      std::vector<std::string> words = {this_program().string(), "register", "--ct"};
      for (const auto& file : parts.ct) words.push_back(file.string());
      words.emplace_back("--image");
      for (const auto& file : parts.images) words.push_back(file.string());
      if (parts.plan) words.insert(words.end(), {"--plan", parts.plan->string()});
      if (parts.structures) words.insert(words.end(), {"--structures", parts.structures->string()});
      words.insert(words.end(), {"--site", watch_.site.path.string(), "--output", tree_.registering(session).string()});
      words.insert(words.end(), watch_.registration.begin(), watch_.registration.end());
      running_ = Running{.session = session,
                         .news = complete.last,
                         .child = std::make_unique<Child>(std::move(words), kLongestRegistration)};
    } catch (const std::exception& error) {
      fail(session, complete.last, error.what(), true);
    }
  }

  void end_registration() {
    const std::optional<ChildEnd> end = running_->child->end(std::chrono::milliseconds(0));
    if (!end) return;
    const std::string session = running_->session;
    const Clock::time_point news = running_->news;
    running_.reset();
    std::string verdict;
    try {
      if (std::filesystem::exists(tree_.registering(session) / kResultFile)) {
        tree_.publish(session);
        verdict = to_string(take_result(session));
      } else {
        fail(session, news, reason_of(*end), !end->is_late);
      }
    } catch (const std::exception& error) {
      fail(session, news, error.what(), true);
    }
    tree_.clean();
    if (verdict.empty()) return;
    failures_.erase(session);
    console_.err << fmt::format("session {}: {}\n", session, verdict);
  }

  static std::string reason_of(const ChildEnd& end) {
    if (end.is_late) return fmt::format("the registration did not end within {} minutes", kLongestRegistration.count());
    if (const std::size_t error = end.output.rfind("error: "); error != std::string::npos)
      return end.output.substr(error);
    return fmt::format("the registration ended with status {} and left no result{}{}", end.status,
                       end.output.empty() ? "" : ": ", end.output.substr(end.output.rfind('\n') + 1));
  }

  void fail(const std::string& session, Clock::time_point news, std::string why, bool may_be_over_soon) {
    static const std::regex staging("[.]partial-[A-Za-z0-9]+");  // another name every time
    why = std::regex_replace(why, staging, "");
    Failure& failure = failures_[session];
    const bool is_new = std::exchange(failure.why, why) != why;
    if (is_new || !may_be_over_soon) failure.again.reset();
    if (!failure.again && may_be_over_soon) failure.again.emplace(kFirstPause, kLongestPause);
    if (failure.again) failure.again->fail();
    failure.news = news;
    if (!is_new) return;
    console_.err << fmt::format("session {}: {}\n", session, why);
    tree_.audit("failed", {{"session", session}});
  }

  // One that cannot be released keeps no other.
  void release_automatically() {
    std::string trouble;
    for (const std::string& session : std::set(accepted_)) {
      try {
        if (!tree_.is_released(session))
          tree_.release(session,
                        {.by = fmt::format("automatic, allowed by {} on {}", watch_.site.automatic_release->by,
                                           watch_.site.automatic_release->on),
                         .user = user_.name,
                         .sudo_user = user_.sudo_user},
                        watch_.names_of_peers());
        accepted_.erase(session);
      } catch (const std::exception& error) {
        trouble = error.what();
      }
    }
    if (!trouble.empty()) throw Error(trouble);
  }

  const WatchFile& watch_;
  Console& console_;
  ResultsTree tree_;
  Inbox inbox_;
  SessionIndex index_;
  Deliverer deliverer_;  // of the thread that sends
  ConsoleObserver sending_{console_};
  std::set<std::string> registered_;  // SOPInstanceUIDs of X-rays that have a result
  std::set<std::string> accepted_;    // sessions to be released without a person
  std::vector<WaitingSession> waiting_;
  std::optional<Running> running_;
  std::map<std::string, Failure> failures_;  // by session
  Troubles troubles_;
  Clock::time_point seen_at_ = Clock::now();     // what had come by then has been seen
  Clock::time_point quiet_from_ = Clock::now();  // a server was down until then
  Clock::time_point next_forgetting_ = Clock::now();
  const SystemUser user_ = system_user();
  bool takes_other_xrays_;  // a machine profile supplies their geometry
};

}  // namespace

void add_watch_command(CLI::App& app, Console& console, int& exit_status) {
  auto file = std::make_shared<std::filesystem::path>();
  CLI::App* command = app.add_subcommand("watch", "Register what comes into a treatment room, and hold the results");
  command->footer(
      "\nExample:\n  isoshift watch /etc/isoshift/watch.json\n\n"
      "Follows a folder or an Orthanc server until it is stopped. index.html among the results lists the sessions.\n"
      "Nothing is sent before it is released. The file: docs/commands/watch.md.");
  command->add_option("file", *file, "Watch file: what is followed, where results go, to whom released ones")
      ->required()
      ->type_name("FILE");
  command->callback([file, &console, &exit_status] {
    const WatchFile watch = read_watch_file(*file);
    const bool has_machine = !checked_registration_flags(watch).study.machine.empty();
    Watch(watch, has_machine, console).run();
    exit_status = kExitAccepted;
  });
}

}  // namespace isoshift
