// isoshift watch: registers what comes into a treatment room, and holds the results until they are released.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <iterator>
#include <map>
#include <memory>
#include <set>
#include <thread>

#include "cli/child_process.h"
#include "cli/commands.h"
#include "cli/deliver.h"
#include "cli/graceful_end.h"
#include "cli/inbox.h"
#include "cli/register_command.h"
#include "cli/session_index.h"
#include "geometry/error.h"
#include "io/report/result_folder.h"
#include "io/results_tree.h"
#include "io/session_files.h"
#include "io/watch_file.h"

namespace isoshift {
namespace {

using Clock = std::chrono::steady_clock;

// Flags of isoshift register that a watch file names must be some, and none of those that watch sets itself.
RegisterOptions checked_registration_flags(const WatchFile& watch) {
  CLI::App app;
  RegisterOptions options;
  add_result_options(app, options);
  add_study_switches(app, options.study);
  add_registration_flags(app, options.flags);
  try {
    app.parse(std::vector<std::string>(watch.registration.rbegin(), watch.registration.rend()));
    options.flags.settle();
  } catch (const CLI::ParseError& error) {
    throw Error(fmt::format("{}: register: {}", watch.path.string(), error.what()));
  }
  if (!options.site.empty())
    throw Error(fmt::format("{}: register: --site is named by site, not here", watch.path.string()));
  return options;
}

class Watch {
 public:
  Watch(const WatchFile& watch, bool takes_other_xrays, Console& console)
      : watch_(watch),
        console_(console),
        tree_(watch.results),
        inbox_(watch, watch.results / "objects"),
        deliverer_(tree_, watch),
        index_(tree_, watch.site.name),
        takes_other_xrays_(takes_other_xrays) {}

  void run() {
    const auto lock = tree_.try_lock();
    if (!lock) throw Error(fmt::format("{}: another isoshift watch is working here", tree_.path().string()));
    const GracefulEnd end;
    tree_.clean();
    take_results();
    tree_.audit("started", {{"sessions", index_.size()}});
    console_.err << fmt::format("watching {}; results in {}\n",
                                watch_.orthanc ? watch_.orthanc->url : watch_.folder.string(), tree_.path().string());
    while (!end.is_asked_for()) {
      // While a server is down nothing is known to be quiet.
      if (!attempt("receiving", [&] { receive(); })) steady_since_ = Clock::now();
      attempt("registering", [&] { register_complete(end); });
      attempt("releasing", [&] { release_automatically(); });
      attempt("sending", [&] { deliverer_.deliver(console_); });
      attempt("writing the index", [&] { index_.update(waiting_); });
      std::this_thread::sleep_for(std::chrono::milliseconds(500));
    }
    tree_.audit("stopped", nlohmann::ordered_json::object());
  }

 private:
  struct Failure {
    std::string why;
    Clock::time_point at;
    Clock::time_point news;  // of the patient, when it failed
    std::chrono::seconds pause{0};
  };
  static constexpr std::chrono::seconds kFirstPause{30}, kLongestPause{600};
  static constexpr std::chrono::days kKeptFor{60};  // objects of a patient of whom nothing comes any more

  // Nothing that fails now ends the watch: a full disk, a server that is down. Each kind of trouble is said once.
  bool attempt(const std::string& what, const std::function<void()>& work) {
    try {
      work();
      if (troubles_.erase(what) > 0) console_.err << what << ": goes on\n";
      return true;
    } catch (const std::exception& error) {
      if (std::exchange(troubles_[what], error.what()) != error.what())
        console_.err << fmt::format("{}: {}\n", what, error.what());
      return false;
    }
  }

  void receive() {
    Notes notes;
    inbox_.update(notes);
    for (const std::string& warning : notes.warnings) console_.err << "warning: " << warning << "\n";
    if (Clock::now() < next_forgetting_) return;
    inbox_.forget_before(std::filesystem::file_time_type::clock::now() - kKeptFor);
    next_forgetting_ = Clock::now() + std::chrono::days(1);
  }

  void take_results() {
    const std::vector<std::string> sessions = tree_.sessions();
    ProgressBar progress(console_, "reading sessions");
    for (std::size_t n = 0; n < sessions.size(); ++n) {
      take_result(sessions[n]);
      progress.update(n + 1, sessions.size());
    }
  }

  Verdict take_result(const std::string& name) {
    const SetupReport report = read_report(tree_.session(name));
    for (const SetupReport::View& view : report.views) registered_.insert(view.sop_instance_uid);
    index_.add(name, report);
    if (watch_.site.automatic_release && report.verdict == Verdict::kAccepted) accepted_.insert(name);
    return report.verdict;
  }

  void register_complete(const GracefulEnd& end) {
    waiting_.clear();
    std::set<std::string> found;
    bool has_retried = false;  // what has failed before does not hold up what is new
    for (const auto& [name, patient] : inbox_.patients()) {
      StudyFiles xrays;
      const auto is_new = [&](const auto& image) { return !registered_.contains(image.sop_instance_uid); };
      std::ranges::copy_if(patient.files.images, std::back_inserter(xrays.images), is_new);
      std::ranges::copy_if(patient.files.other_xrays, std::back_inserter(xrays.other_xrays), is_new);
      for (const SessionFiles& session : sessions_of(xrays, takes_other_xrays_)) {
        if (end.is_asked_for()) return;
        found.insert(session.name);
        const StudyFiles own = files_for(session, patient.files);
        const bool has_failed = failures_.contains(session.name);
        std::string why = reason_to_wait(session, own, patient.last);
        if (why.empty() && has_failed && std::exchange(has_retried, true)) why = failures_.at(session.name).why;
        if (why.empty()) why = registered(session, own, patient.last);
        if (!why.empty())
          waiting_.push_back({session.name, session.patient, std::move(why), failures_.contains(session.name)});
      }
    }
    std::erase_if(failures_, [&](const auto& failure) { return !found.contains(failure.first); });
  }

  // Empty: it can be registered now.
  std::string reason_to_wait(const SessionFiles& session, const StudyFiles& own, Clock::time_point last) {
    const SiteFile::Sessions& rule = *watch_.site.sessions;
    if (static_cast<int>(session.images.size()) < rule.views)
      return fmt::format("{} of {} X-rays", session.images.size(), rule.views);
    if (const auto missing = missing_parts(own); !missing.empty()) {
      inbox_.ask_for_rest(session.patient);
      return "waits for " + missing.front();
    }
    if (!inbox_.is_settled() ||
        Clock::now() - std::max(last, steady_since_) < std::chrono::duration<double>(rule.quiet_s))
      return "more may come";
    const auto failure = failures_.find(session.name);
    if (failure == failures_.end()) return "";
    const bool has_news = last != failure->second.news;
    return has_news || Clock::now() - failure->second.at > failure->second.pause ? "" : failure->second.why;
  }

  // Registers in a process of its own, whatever it meets there. Returns why there is no result.
  std::string registered(const SessionFiles& session, const StudyFiles& own, Clock::time_point last) {
    std::string why;
    const auto has_result = [&] { return std::filesystem::exists(tree_.session(session.name) / kResultFile); };
    try {
      const StudyParts parts = choose_parts(own);
      std::vector<std::string> words = {this_program().string(), "register", "--ct"};
      for (const auto& file : parts.ct) words.push_back(file.string());
      words.emplace_back("--image");
      for (const auto& file : parts.images) words.push_back(file.string());
      if (parts.plan) words.insert(words.end(), {"--plan", parts.plan->string()});
      if (parts.structures) words.insert(words.end(), {"--structures", parts.structures->string()});
      words.insert(words.end(),
                   {"--site", watch_.site.path.string(), "--output", tree_.session(session.name).string()});
      words.insert(words.end(), watch_.registration.begin(), watch_.registration.end());
      const ChildEnd end = run_child(std::move(words), kLongestRegistration);
      if (end.is_late)
        why = fmt::format("the registration did not end within {} minutes", kLongestRegistration.count());
      else if (!has_result() && end.status == kExitFailed)
        why = end.output.substr(std::min(end.output.size(), end.output.rfind("error: ")));
      else if (!has_result())
        why = fmt::format("the registration ended with status {} and left no result", end.status);
    } catch (const std::exception& error) {
      why = error.what();
    }
    if (!why.empty()) {
      Failure& failure = failures_[session.name];
      const bool is_new = std::exchange(failure.why, why) != why;
      failure.pause = is_new ? kFirstPause : std::min(2 * failure.pause, kLongestPause);
      failure.at = Clock::now();
      failure.news = last;
      if (is_new) {
        console_.err << fmt::format("session {}: {}\n", session.name, why);
        tree_.audit("failed", {{"session", session.name}});
      }
      return why;
    }
    failures_.erase(session.name);
    const std::string verdict(to_string(take_result(session.name)));
    console_.err << fmt::format("session {}: {}\n", session.name, verdict);
    tree_.audit("registered", {{"session", session.name}, {"verdict", verdict}});
    return "";
  }

  void release_automatically() {
    while (!accepted_.empty()) {
      const std::string& session = *accepted_.begin();
      if (!tree_.is_released(session))
        tree_.release(session,
                      fmt::format("automatic, allowed by {} on {}", watch_.site.automatic_release->by,
                                  watch_.site.automatic_release->on),
                      watch_.names_of_peers());
      accepted_.erase(accepted_.begin());
    }
  }

  const WatchFile& watch_;
  Console& console_;
  ResultsTree tree_;
  Inbox inbox_;
  Deliverer deliverer_;
  SessionIndex index_;
  std::set<std::string> registered_;  // SOPInstanceUIDs of X-rays that have a result
  std::set<std::string> accepted_;    // sessions to be released without a person
  std::vector<WaitingSession> waiting_;
  std::map<std::string, Failure> failures_;  // by session
  std::map<std::string, std::string> troubles_;
  Clock::time_point steady_since_ = Clock::now();  // everything that came has been seen
  Clock::time_point next_forgetting_ = Clock::now();
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
