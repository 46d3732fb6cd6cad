// isoshift watch: registers what comes into a treatment room, and holds the results until they are released.

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <thread>

#include "cli/child_process.h"
#include "cli/commands.h"
#include "cli/deliver.h"
#include "cli/graceful_end.h"
#include "cli/inbox.h"
#include "cli/register_command.h"
#include "geometry/error.h"
#include "io/file_lock.h"
#include "io/output_folder.h"
#include "io/report/formats.h"
#include "io/report/result_folder.h"
#include "io/report/results_page.h"
#include "io/results_tree.h"
#include "io/watch_file.h"

namespace isoshift {
namespace {

using Clock = std::chrono::steady_clock;
constexpr const char* kLockFile = ".watch.lock";

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
        takes_other_xrays_(takes_other_xrays) {}

  void run() {
    const auto lock = FileLock::try_take(tree_.path() / kLockFile);
    if (!lock) throw Error(fmt::format("{}: another isoshift watch is working here", tree_.path().string()));
    const GracefulEnd end;
    tree_.clean();
    for (const std::string& name : tree_.sessions()) take_result(name);
    tree_.audit("started", {{"sessions", results_.size()}});
    console_.err << fmt::format("watching {}; results in {}\n",
                                watch_.orthanc ? watch_.orthanc->url : watch_.folder.string(), tree_.path().string());
    while (!end.is_asked_for()) {
      // While a server is down nothing is known to be quiet.
      if (!attempt("receiving", [&] { receive(); })) steady_since_ = Clock::now();
      attempt("registering", [&] { register_complete(end); });
      attempt("releasing", [&] { release_automatically(); });
      attempt("sending", [&] { deliverer_.deliver(console_); });
      attempt("writing the index", [&] { write_index(); });
      std::this_thread::sleep_for(std::chrono::milliseconds(500));
    }
    tree_.audit("stopped", nlohmann::ordered_json::object());
  }

 private:
  // What is not registered yet, and why.
  struct Waiting {
    SessionFiles session;
    std::string why;
    bool failed = false;
  };
  struct Failure {
    std::string why;
    Clock::time_point at;
    std::optional<Clock::time_point> news;  // of the patient, when it failed
    std::chrono::seconds pause{0};
  };
  static constexpr std::chrono::seconds kFirstPause{30}, kLongestPause{600};

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
  }

  void take_result(const std::string& name) {
    const std::filesystem::path path = tree_.session(name) / kResultFile;
    std::ifstream file(path, std::ios::binary);
    SetupReport report = report_from_json({std::istreambuf_iterator<char>(file), {}}, path.string());
    for (const SetupReport::View& view : report.views) registered_.insert(view.sop_instance_uid);
    results_.insert_or_assign(name, std::move(report));
  }

  void register_complete(const GracefulEnd& end) {
    StudyFiles files = inbox_.files();
    const auto is_done = [&](const auto& image) { return registered_.contains(image.sop_instance_uid); };
    std::erase_if(files.images, is_done);
    std::erase_if(files.other_xrays, is_done);
    waiting_.clear();
    bool has_retried = false;  // what has failed before does not hold up what is new
    for (SessionFiles& session : sessions_of(files, takes_other_xrays_)) {
      if (end.is_asked_for()) return;
      const StudyFiles own = files_for(session, files);
      const bool has_failed = failures_.contains(session.name);
      std::string why = reason_to_wait(session, own);
      if (why.empty() && has_failed && std::exchange(has_retried, true)) why = failures_.at(session.name).why;
      if (why.empty()) why = registered(session, own);
      if (why.empty()) continue;
      const bool failed = failures_.contains(session.name);
      waiting_.push_back({std::move(session), std::move(why), failed});
    }
  }

  // Empty: it can be registered now.
  std::string reason_to_wait(const SessionFiles& session, const StudyFiles& own) const {
    const SiteFile::Sessions& rule = *watch_.site.sessions;
    if (static_cast<int>(session.images.size()) < rule.views)
      return fmt::format("{} of {} X-rays", session.images.size(), rule.views);
    if (const auto missing = missing_parts(own); !missing.empty()) return "waits for " + missing.front();
    const auto last = inbox_.last_of(session.patient);
    if (!inbox_.is_settled() || Clock::now() - std::max(last.value_or(steady_since_), steady_since_) <
                                    std::chrono::duration<double>(rule.quiet_s))
      return "more may come";
    const auto failure = failures_.find(session.name);
    if (failure == failures_.end()) return "";
    const bool has_news = last != failure->second.news;
    return has_news || Clock::now() - failure->second.at > failure->second.pause ? "" : failure->second.why;
  }

  // Registers in a process of its own, whatever it meets there. Returns why there is no result.
  std::string registered(const SessionFiles& session, const StudyFiles& own) {
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
      const ChildEnd end = run_child(std::move(words));
      if (!has_result() && end.status == kExitFailed)
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
      failure.news = inbox_.last_of(session.patient);
      if (is_new) {
        console_.err << fmt::format("session {}: {}\n", session.name, why);
        tree_.audit("failed", {{"session", session.name}});
      }
      return why;
    }
    failures_.erase(session.name);
    take_result(session.name);
    const std::string verdict(to_string(results_.at(session.name).verdict));
    console_.err << fmt::format("session {}: {}\n", session.name, verdict);
    tree_.audit("registered", {{"session", session.name}, {"verdict", verdict}});
    return "";
  }

  void release_automatically() {
    if (!watch_.site.automatic_release) return;
    for (const auto& [name, report] : results_)
      if (report.verdict == Verdict::kAccepted && !tree_.release_of(name))
        tree_.release(name,
                      fmt::format("automatic, allowed by {} on {}", watch_.site.automatic_release->by,
                                  watch_.site.automatic_release->on),
                      names_of_peers(watch_));
  }

  std::string status_of(const std::string& name, const std::vector<Delivery>& pending) const {
    const auto release = tree_.release_of(name);
    if (!release) return results_.at(name).verdict == Verdict::kRejected ? "rejected" : "held";
    const auto left = std::ranges::count(pending, name, &Delivery::session);
    return fmt::format("released by {} on {}{}", release->by, release->on,
                       left > 0 ? fmt::format("; {} to be sent", left) : "; sent");
  }

  void write_index() {
    const std::vector<Delivery> pending = tree_.pending();
    ResultsPage page{.title = fmt::format("isoshift: sessions of {}", watch_.site.name), .refresh_s = 10};
    page.columns = {"Session", "Patient", "Acquired", "Verdict", "Action", "State"};
    for (const Waiting& waiting : waiting_)
      page.rows.push_back({.verdict = waiting.failed ? "failed" : "waiting",
                           .cells = {{.text = waiting.session.name},
                                     {.text = waiting.session.patient.substr(0, waiting.session.patient.find('\\'))},
                                     {.text = ""},
                                     {.text = waiting.failed ? "failed" : "waiting"},
                                     {.text = ""},
                                     {.text = waiting.why}}});
    std::vector<std::pair<std::string, const SetupReport*>> newest;
    for (const auto& [name, report] : results_) newest.emplace_back(name, &report);
    std::ranges::stable_sort(newest, std::ranges::greater(),
                             [](const auto& one) { return one.second->views.front().acquired; });
    for (const auto& [name, report] : newest)
      page.rows.push_back(
          {.verdict = std::string(to_string(report->verdict)),
           .cells = {{.text = name, .link = "sessions/" + name + "/report.html"},
                     {.text = fmt::format("{} ({})", report->identity.patient_name, report->identity.patient_id)},
                     {.text = report->views.front().acquired},
                     {.text = std::string(to_string(report->verdict))},
                     {.text = std::string(to_string(shown_shift(*report).action))},
                     {.text = status_of(name, pending)}}});
    page.summary = {
        fmt::format("{} sessions registered, {} waiting. Nothing is sent before somebody releases it: isoshift "
                    "release SESSION --by NAME",
                    results_.size(), waiting_.size())};
    std::string html = results_html(page);
    if (html == index_) return;
    replace_text(tree_.path() / "index.html", html);
    index_ = std::move(html);
  }

 public:
  static std::vector<std::string> names_of_peers(const WatchFile& watch) {
    std::vector<std::string> names;
    for (const DicomPeer& peer : watch.peers) names.push_back(peer.name);
    return names;
  }

 private:
  const WatchFile& watch_;
  Console& console_;
  ResultsTree tree_;
  Inbox inbox_;
  Deliverer deliverer_;
  std::map<std::string, SetupReport> results_;  // by session, without pictures
  std::set<std::string> registered_;            // SOPInstanceUIDs of their X-rays
  std::vector<Waiting> waiting_;
  std::map<std::string, Failure> failures_;
  std::map<std::string, std::string> troubles_;
  std::string index_;
  Clock::time_point steady_since_ = Clock::now();  // everything that came has been seen
  bool takes_other_xrays_;                         // a machine profile supplies their geometry
};

void run_release(const std::filesystem::path& file, const std::string& session, const std::string& by,
                 Console& console) {
  if (by.find_first_not_of(' ') == std::string::npos) throw UsageError("--by: expected the name of who releases it");
  const WatchFile watch = read_watch_file(file);
  // What another user writes the watch could not read.
  struct stat of_results {};
  if (::stat(watch.results.c_str(), &of_results) == 0 && of_results.st_uid != ::geteuid())
    throw Error(fmt::format("{}: belongs to another user, who runs isoshift watch: release as that one (sudo -u USER)",
                            watch.results.string()));
  const ResultsTree tree(watch.results);
  const Release release = tree.release(session, by, Watch::names_of_peers(watch));
  for (const Release::Object& object : release.objects)
    console.out << fmt::format("{} goes to {}\n", object.file,
                               release.peers.empty() ? "nobody: the watch file names no peers"
                                                     : fmt::format("{}", fmt::join(release.peers, ", ")));
  if (release.objects.size() == 1) console.out << "the session holds no registration object\n";
  if (const auto lock = FileLock::try_take(tree.path() / kLockFile))
    Deliverer(tree, watch).deliver(console);  // nobody else does
  const auto left = std::ranges::count(tree.pending(), session, &Delivery::session);
  console.out << (left == 0 ? "sent\n" : "isoshift watch sends it, as often as it takes\n");
}

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

void add_release_command(CLI::App& app, Console& console, int& exit_status) {
  struct Options {
    std::filesystem::path watch = "/etc/isoshift/watch.json";
    std::string session, by;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("release", "Send a result of watch to its peers");
  command->footer(
      "\nExample:\n  isoshift release 3fa94c1e02b7 --by \"J. Doe\"\n\n"
      "Records who released what, then sends spatial_registration.dcm, where there is one, and report.dcm.");
  command->add_option("session", options->session, "As index.html names it")->required()->type_name("SESSION");
  command->add_option("--by", options->by, "Who has looked at it and releases it")->required()->type_name("NAME");
  command->add_option("--watch", options->watch, "The watch file")->type_name("FILE")->capture_default_str();
  command->callback([options, &console, &exit_status] {
    run_release(options->watch, options->session, options->by, console);
    exit_status = kExitAccepted;
  });
}

}  // namespace isoshift
