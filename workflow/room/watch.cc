#include "workflow/room/watch.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>
#include <thread>
#include <utility>

#include "base/error.h"
#include "base/pattern.h"
#include "base/sha256.h"
#include "io/report/result_folder.h"

namespace isoshift {
namespace {

constexpr std::chrono::milliseconds kRound(500);
constexpr std::chrono::seconds kFirstPause(30), kLongestPause(600);
constexpr std::chrono::days kKeptFor(60);  // objects of a patient of whom nothing comes any more

FileLock only_watch_of(const ResultsTree& tree) {
  auto lock = tree.try_lock();
  if (!lock) throw Error(fmt::format("{}: another isoshift room watch is working here", tree.path().string()));
  return *std::move(lock);
}

}  // namespace

Watch::Watch(const WatchFile& watch, const Parts& parts)
    : watch_(watch),
      parts_(parts),
      tree_(watch),
      lock_(only_watch_of(tree_)),
      objections_(tree_.objections(), parts.takes_other_xrays),
      kept_objections_(objections_.by_session()),
      index_(tree_, watch.site.name),
      engine_(tree_.path(), parts.clock),
      deliverer_(watch, parts.sender, parts.clock),
      grouping_(parts.takes_other_xrays),
      changes_(tree_, grouping_, parts.contents),
      troubles_(parts.observer),
      sending_troubles_(parts.sending),
      seen_at_(parts.clock.now()),
      quiet_from_(seen_at_),
      next_forgetting_(seen_at_),
      next_deletion_(seen_at_) {
  tree_.clean();
  troubles_.attempt("taking choices", [&] { take_choices(); });
  take_results();
  tree_.audit("started", {{"sessions", index_.size()}});
}

void Watch::round() {
  if (!lock_.is_in_place())
    throw Error(
        fmt::format("{}: its .watch.lock was removed or replaced, so another isoshift room watch may be working here: "
                    "this watch ends",
                    tree_.path().string()));
  set_sendable({});
  was_source_read_ = is_source_read_;
  released_.clear();
  troubles_.attempt("reading releases", [&] { released_ = tree_.released(); });
  troubles_.attempt("receiving", [&] { receive(); });
  troubles_.attempt("comparing clocks", [&] { compare_clocks(); });
  troubles_.attempt("deleting old results", [&] { delete_old_results(); });
  troubles_.attempt("deleting results", [&] { take_deletions(); });
  troubles_.attempt("taking choices", [&] { take_choices(); });
  troubles_.attempt("comparing files with results", [&] { look_for_changes(); });
  troubles_.attempt("registering", [&] { register_complete(); });
  troubles_.attempt("taking over results by hand", [&] { take_over_results(); });
  troubles_.attempt("comparing X-rays with results", [&] {
    look_for_objections();
    // In its first round a source may only have seen that there are files.
    set_sendable({.is_known = was_source_read_ && is_source_read_,
                  .released = released_,
                  .waiting = objections_.sessions_of([&](const std::string& id) { return may_have_news(id); })});
  });
  troubles_.attempt("releasing", [&] { release_automatically(); });
  troubles_.attempt("writing the audit log", [&] { tree_.write_kept_audit(); });
  troubles_.attempt("writing the index", [&] { index_.update(waiting_, troubles(), objections_.by_session()); });
  troubles_.attempt("writing engine.json",
                    [&] { engine_.update({.waiting = waiting_, .chosen = chosen_, .troubles = troubles()}); });
}

std::vector<std::string> Watch::troubles() const {
  std::vector<std::string> lines = troubles_.lines();
  std::ranges::move(parts_.source.unreadable(), std::back_inserter(lines));
  return lines;
}

void Watch::deliver(const std::stop_token& stop) {
  const auto may_be_sent = [&](const std::string& session) {
    const std::lock_guard lock(sendable_mutex_);
    return sendable_.is_known && sendable_.released.contains(session) && !sendable_.waiting.contains(session);
  };
  sending_troubles_.attempt("sending", [&] { deliverer_.deliver(stop, may_be_sent, parts_.sending); });
}

void Watch::run(const std::function<bool()>& is_end_asked_for) {
  std::jthread sending([this](const std::stop_token& stop) {  // a peer may take its time
    while (!stop.stop_requested()) {
      deliver(stop);
      parts_.clock.wait(kRound);
    }
  });
  while (!is_end_asked_for()) {
    round();
    parts_.clock.wait(kRound);
  }
  parts_.runner.give_up();
  sending.request_stop();
  sending.join();
  tree_.audit("stopped", nlohmann::ordered_json::object());
}

// While a server is down nothing is known to be quiet.
void Watch::receive() {
  const Clock::Time begin = parts_.clock.now();
  is_source_read_ = false;
  Notes notes;
  const auto say_warnings = [&] {
    for (const std::string& warning : notes.warnings) parts_.observer.say("warning: " + warning);
  };
  try {
    parts_.source.update(notes);
  } catch (const std::exception&) {
    say_warnings();
    quiet_from_ = parts_.clock.now();
    throw;
  }
  say_warnings();
  seen_at_ = begin;
  is_source_read_ = true;
  if (parts_.clock.now() < next_forgetting_) return;
  std::set<std::string> unregistered;  // patients of whom an X-ray has no result
  for (const auto& [patient_id, patient] : parts_.source.patients())
    if (!grouping_.are_all_registered(patient.files)) unregistered.insert(patient_id);
  parts_.source.forget_before(parts_.clock.file_time() - kKeptFor, unregistered);
  next_forgetting_ = parts_.clock.now() + std::chrono::days(1);
}

void Watch::compare_clocks() {
  const auto& limit_s = watch_.site.sessions->max_clock_offset_s;
  if (!limit_s || !is_source_read_) return;
  const bool is_coming = std::ranges::any_of(
      parts_.source.patients(), [&](const auto& patient) { return parts_.source.is_coming(patient.first); });
  if (!are_clocks_compared_ && (!was_source_read_ || is_coming)) return;  // what was there before is still being read
  are_clocks_compared_ = true;
  clocks_.update(parts_.source.patients(), std::chrono::file_clock::to_sys(parts_.clock.file_time()));
  if (const std::string words = clocks_.beyond(*limit_s); !words.empty()) throw Error(words);
}

// Once a day. What is still to be sent stays until it is sent.
void Watch::delete_old_results() {
  if (!watch_.keep_days || parts_.clock.now() < next_deletion_) return;
  const auto oldest = parts_.clock.file_time() - std::chrono::days(*watch_.keep_days);
  for (const std::string& session : tree_.sessions()) {
    const std::string newest = tree_.newest_of_same_xrays(session);
    const auto registered_at = tree_.registered_at(newest);  // nothing: deleted with an earlier result
    if (!registered_at || *registered_at >= oldest || tree_.is_to_be_sent(newest)) continue;
    tree_.remove(session, fmt::format("keep_days {} of the watch file", *watch_.keep_days));
    parts_.observer.say(fmt::format("session {}: deleted, {} days after its registration", session, *watch_.keep_days));
  }
  next_deletion_ = parts_.clock.now() + std::chrono::days(1);
}

// Results that this watch or isoshift room delete has deleted are not listed any more, and their X-rays not registered.
void Watch::take_deletions() {
  const auto newest = tree_.newest_deletion();
  if (deletions_read_ != newest) {
    for (const Deletion& deletion : tree_.finish_deletions()) {
      index_.remove(deletion.session);
      grouping_.remove(deletion.session);
      objections_.remove(deletion.session);
      changes_.remove(deletion.session);
      grouping_.add_deleted(deletion.xrays);
    }
    deletions_read_ = newest;
  }
  for (const auto& [patient_id, patient] : parts_.source.patients()) grouping_.see(patient.files);
}

// What people have chosen on the screen. A choice that does not count hides no other.
void Watch::take_choices() {
  const std::map<std::string, std::string> there = tree_.chosen();
  if (choices_read_ != there || !choice_trouble_.empty()) read_choices(there);
  choices_read_ = there;
  if (!choice_trouble_.empty()) throw Error(choice_trouble_);
}

void Watch::read_choices(const std::map<std::string, std::string>& there) {
  std::map<std::string, Choice> choices;
  choice_trouble_.clear();
  for (const auto& [session, version] : there) {
    try {
      if (auto choice = tree_.choice(session)) choices[session] = *std::move(choice);
    } catch (const std::exception& error) {
      choice_trouble_ = error.what();
    }
  }
  for (const auto& [session, choice] : choices) {
    const auto before = choices_.find(session);
    if (before != choices_.end() && before->second == choice) continue;
    failures_.erase(session);
    changes_.compare_again(choice.patient_id);
    if (choices_read_) parts_.observer.say(fmt::format("session {}: {}", session, in_words(choice)));
    if (choice.is_withdrawn) objections_.add(tree_.newest_of_same_xrays(session), in_words(choice));
  }
  choices_ = choices;
  grouping_.set_choices(std::move(choices));
}

// A result that cannot be read hides no other.
void Watch::take_results() {
  const std::vector<std::string> sessions = tree_.sessions();
  for (std::size_t n = 0; n < sessions.size(); ++n) {
    try {
      take_result(sessions[n]);
    } catch (const std::exception& error) {
      parts_.observer.say(fmt::format("warning: session {}: {}", sessions[n], error.what()));
    }
    parts_.observer.progress("reading sessions", n + 1, sessions.size());
  }
}

void Watch::take_result(const std::string& session, const std::optional<Running>& made) {
  const SetupResult report = read_report(tree_.session(session));
  if (report.views.empty()) throw Error(fmt::format("{}: names no views", tree_.session(session).string()));
  std::set<std::string> xrays;
  for (const auto& view : report.views) xrays.insert(view.sop_instance_uid);
  grouping_.add_result(session, xrays);
  changes_.add_result(session, report.identity.patient_id);
  const std::string obstacle = obstacle_to_release(tree_, session, report.verdict());
  const std::string reason = reason_for_person(session, report, made);
  index_.add(session, report, obstacle, reason);
  objections_.add_result(session, report, grouping_.is_regrouped(session));
  if (made) parts_.observer.say(fmt::format("session {}: {}", session, to_string(report.verdict())));
  if (made && watch_.site.automatic_release && report.verdict() == Verdict::kAccepted && obstacle.empty() &&
      reason.empty())
    accepted_[session] = made->patient_id;
}

// Why the site's rule does not release an accepted result. Empty: it may, or there is no such rule.
std::string Watch::reason_for_person(const std::string& session, const SetupResult& result,
                                     const std::optional<Running>& made) const {
  if (!watch_.site.automatic_release || result.verdict() != Verdict::kAccepted) return "";
  if (!result.site || result.site->sha256 != watch_.site.sha256) return "it was made under another site file";
  if (name_of_xrays(session) != session)
    return made ? "its X-rays were registered before, from other files" : "a person has made it by hand";
  if (!made) return "an earlier run of watch registered it";  // X-rays may have come and gone since
  return made->names_plan ? "" : "not all of its X-rays name their plan";
}

// Those that people have made by hand on the screen. One that cannot be taken over hides no other.
void Watch::take_over_results() {
  std::string trouble;
  for (const std::string& session : tree_.handed_over()) {
    try {
      take_over(session);
    } catch (const std::exception& error) {
      trouble = error.what();
    }
  }
  if (!trouble.empty()) throw Error(trouble);
}

// What speaks against the result before it does so against one by hand, which was made from the same files.
void Watch::take_over(const std::string& session) {
  const std::string before = tree_.newest_of_same_xrays(session);
  const std::optional<SessionInputs> inputs_before = tree_.inputs(session);
  const bool is_overtaken =
      changes_.is_to_be_registered(session) || (running_ && name_of_xrays(running_->session) == session);
  const std::string name = tree_.take_over(session);
  parts_.observer.say(fmt::format("session {}: made by hand", name));
  objections_.inherit(before, name);
  if (is_overtaken || tree_.inputs(name) != inputs_before)
    objections_.add(name, "it was made by hand from files that are others now");
  take_result(name);
  for (const auto& [patient_id, patient] : parts_.source.patients())
    if (std::ranges::any_of(grouping_.results_of(patient.files),
                            [&](const auto& one) { return one.second == session; }))
      changes_.compare_again(patient_id);
}

// One at a time, those with the newest X-rays first: somebody waits for them.
void Watch::register_complete() {
  if (running_) end_registration();
  const std::vector<Complete> complete = complete_sessions();
  if (running_ || complete.empty()) return;
  begin_registration(*std::ranges::min_element(complete, {}, [&](const Complete& one) {
    return std::pair(failures_.contains(one.session.name), -one.session.images.back().at_s.value_or(0.0));
  }));
}

// Those that can be registered now. Lists all that have no result as waiting, with the reason.
std::vector<Watch::Complete> Watch::complete_sessions() {
  waiting_.clear();
  chosen_.clear();
  std::vector<Complete> complete;
  std::set<std::string> found;
  for (const auto& [patient_id, patient] : parts_.source.patients()) {
    std::vector<SessionFiles> sessions = grouping_.sessions_in(patient.files);
    std::ranges::move(changes_.to_register(patient_id, patient.files), std::back_inserter(sessions));
    std::vector<SessionFiles> chosen = grouping_.chosen_in(patient.files);
    std::ranges::copy_if(changes_.ambiguous_in(patient_id, patient.files), std::back_inserter(chosen),
                         [&](const SessionFiles& one) {
                           return std::ranges::find(chosen, one.name, &SessionFiles::name) == chosen.end();
                         });
    for (const SessionFiles& session : chosen)
      chosen_.push_back({.name = session.name,
                         .patient_id = patient_id,
                         .acquired = times_of(session.images),
                         .why = "has a result",
                         .options = grouping_.options_of(session, patient.files)});
    for (SessionFiles& session : sessions) {
      found.insert(session.name);
      StudyFiles own = grouping_.files_of(session, patient.files);
      WaitingSession& waits = waiting_.emplace_back(waiting(session, own, patient_id, patient));
      if (!waits.why.empty()) continue;
      waits.why = "is next to be registered";
      complete.push_back({std::move(session), std::move(own), patient.last});
    }
  }
  std::erase_if(failures_, [&](const auto& failure) { return !found.contains(failure.first); });
  return complete;
}

// Without a reason: it can be registered now. What a person may choose counts where something else than time is
// missing.
WaitingSession Watch::waiting(const SessionFiles& session, const StudyFiles& own, const std::string& patient_id,
                              const Patient& patient) {
  const bool is_running = running_ && running_->session == session.name;
  WaitingSession waits{
      .name = session.name,
      .patient_id = patient_id,
      .acquired = times_of(session.images),
      .why = is_running ? "is being registered" : reason_to_wait(session, own, patient_id, patient.last),
      .has_failed = failures_.contains(session.name),
      .options = {}};
  const bool is_again = name_of_xrays(session.name) != session.name;
  if (!is_running && !waits.why.empty() && !is_again && is_quiet(patient_id, patient.last))
    waits.options = grouping_.options_of(session, patient.files);
  return waits;
}

// Empty: it can be registered now.
std::string Watch::reason_to_wait(const SessionFiles& session, const StudyFiles& own, const std::string& patient_id,
                                  Clock::Time last) {
  const SiteFile::Sessions& rule = *watch_.site.sessions;
  if (static_cast<int>(session.images.size()) < rule.views)
    return fmt::format("{} of {} X-rays{}{}", session.images.size(), rule.views, session.remarks.empty() ? "" : "; ",
                       fmt::join(session.remarks, "; "));
  if (const auto missing = grouping_.missing_of(session, own); !missing.empty()) {
    parts_.source.ask_for_rest(patient_id);
    return "waits for " + missing.front();
  }
  if (!is_quiet(patient_id, last)) return "more files may arrive";
  const auto failure = failures_.find(session.name);
  if (failure == failures_.end() || last != failure->second.news) return "";
  const auto& [why, news, again] = failure->second;
  return again && again->is_due(parts_.clock.now()) ? "" : why;
}

bool Watch::is_quiet(const std::string& patient_id, Clock::Time last) const {
  const std::chrono::duration<double> quiet = seen_at_ - std::max(last, quiet_from_);
  return !parts_.source.is_coming(patient_id) && quiet.count() >= watch_.site.sessions->quiet_s;
}

// A result whose files are others now is objected to, and its X-rays are registered again.
void Watch::look_for_changes() {
  changes_.look(
      parts_.source.patients(),
      [&](const std::string& patient_id, Clock::Time last) { return is_quiet(patient_id, last); },
      [&](const std::string& session, const std::string& what) {
        parts_.observer.say(fmt::format("session {}: {}", session, what));
        objections_.add(session, what);
      });
}

void Watch::begin_registration(const Complete& complete) {
  const std::string& session = complete.session.name;
  for (const std::string& remark : complete.session.remarks)
    parts_.observer.say(fmt::format("session {}: {}", session, remark));
  try {
    tree_.check_is_new(session);
    StudyParts parts = choose_parts(complete.files);
    std::ranges::copy(complete.session.doubts, std::back_inserter(parts.doubts));
    if (const std::string reason = unreadable_beside(parts, parts_.source.unreadable()); !reason.empty())
      parts.doubts.push_back("a file beside the X-rays may belong to them: " + reason);
    const SessionInputs inputs = inputs_of(parts, parts_.contents);
    RegistrationOrder order{.parts = parts, .flags = watch_.registration, .site = watch_.site.path};
    std::ranges::copy(grouping_.flags_of(complete.session), std::back_inserter(order.flags));
    tree_.keep_order(session, order);
    order.output = tree_.registering(session);
    parts_.runner.begin(order);
    const auto names_plan = [](const StudyFiles::Image& image) { return !image.plan_uid.empty(); };
    running_ = Running{.session = session,
                       .news = complete.last,
                       .patient_id = patient_id_of(complete.session.patient),
                       .names_plan = std::ranges::all_of(complete.session.images, names_plan),
                       .inputs = inputs};
  } catch (const std::exception& error) {
    fail(session, complete.last, {.why = error.what()});
  }
}

void Watch::end_registration() {
  const std::optional<Runner::End> end = parts_.runner.end();
  if (!end) return;
  const std::optional<Running> made = std::exchange(running_, std::nullopt);
  const std::string& session = made->session;
  const Clock::Time news = made->news;
  try {
    if (end->failure) {
      fail(session, news, *end->failure);
    } else {
      tree_.keep_inputs(session, made->inputs);
      tree_.publish(session, end->files);
      changes_.registered(session);
      changes_.compare_again(made->patient_id);  // somebody may have chosen in the meantime
      take_result(session, made);
    }
  } catch (const std::exception& error) {
    fail(session, news, {.why = error.what()});
  }
  tree_.clean();
}

void Watch::fail(const std::string& session, Clock::Time news, const Runner::Failure& failed) {
  static const Pattern staging("[.]partial-[A-Za-z0-9]+");  // another name every time
  const std::string why = staging.removed_from(failed.why);
  Failure& failure = failures_[session];
  const bool is_new = std::exchange(failure.why, why) != why;
  if (is_new || !failed.may_be_over_soon) failure.again.reset();
  if (!failure.again && failed.may_be_over_soon) failure.again.emplace(kFirstPause, kLongestPause);
  if (failure.again) failure.again->fail(parts_.clock.now());
  failure.news = news;
  if (!is_new) return;
  parts_.observer.say(fmt::format("session {}: {}", session, why));
  tree_.audit("failed", {{"session", session}});
}

void Watch::look_for_objections() {
  objections_.update(parts_.source.patients(), grouping_.registered());
  if (objections_.by_session() == kept_objections_) return;
  tree_.keep_objections(objections_.by_session());
  kept_objections_ = objections_.by_session();
}

// A file that is coming may be an X-ray that speaks against results; one that has come may be another plan, which is
// compared with that of the results once no more files come.
bool Watch::may_have_news(const std::string& patient_id) const {
  return parts_.source.is_coming(patient_id) || !changes_.is_compared(patient_id, parts_.source.patients());
}

void Watch::set_sendable(Sendable sendable) {
  const std::lock_guard lock(sendable_mutex_);
  sendable_ = std::move(sendable);
}

void Watch::release_by_rule(const std::string& session) {
  if (tree_.is_released(session)) return;
  tree_.release(session,
                {.by = fmt::format("automatic, allowed by {} on {}", watch_.site.automatic_release->by,
                                   watch_.site.automatic_release->on),
                 .user = user_.name,
                 .sudo_user = user_.sudo_user,
                 .is_person = false},
                watch_.names_of_peers());
  const std::lock_guard lock(sendable_mutex_);
  sendable_.released.insert(session);  // of what this round has read
}

// A release that fails must not block the others. A result against which other X-rays speak is released by a person or
// not at all; while the source does not answer, files of the patient come or were not compared with the result yet, or
// a file of the source, of whatever patient, cannot be read, it is not known whether any do.
void Watch::release_automatically() {
  if (!is_source_read_ || !parts_.source.unreadable().empty()) return;
  std::erase_if(accepted_, [&](const auto& one) { return objections_.by_session().contains(one.first); });
  std::string trouble;
  std::erase_if(accepted_, [&](const auto& one) {
    const auto& [session, patient_id] = one;
    if (may_have_news(patient_id)) return false;
    try {
      release_by_rule(session);
      return true;
    } catch (const std::exception& error) {
      trouble = error.what();
      return false;
    }
  });
  if (!trouble.empty()) throw Error(trouble);
}

}  // namespace isoshift
