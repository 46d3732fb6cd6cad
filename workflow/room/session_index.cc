#include "workflow/room/session_index.h"

#include <fmt/format.h>

#include <algorithm>
#include <regex>

#include "base/output_folder.h"
#include "base/sha256.h"
#include "io/report/results_page.h"
#include "setup/shown_shift.h"

namespace isoshift {
namespace {

constexpr std::size_t kNewest = 500;  // sessions in index.html
constexpr int kRefreshS = 10;

// "2026-03" of "2026-03-01 10:15:00".
std::string month_of(const std::string& acquired) {
  static const std::regex pattern("[0-9]{4}-[0-9]{2}");
  std::string month = acquired.substr(0, std::string_view("2026-03").size());
  return std::regex_match(month, pattern) ? month : "undated";
}

// A page's file, "sessions-2026-03.html".
std::string page_of_month(const std::string& month) { return "sessions-" + month + ".html"; }

// "KV_AP 2026-03-01 10:15:00; KV_LAT ...", of anything with a label and a time.
template <class Xray>
std::string times_in_words(const std::vector<Xray>& xrays) {
  std::string words;
  for (const Xray& xray : xrays)
    words += fmt::format("{}{} {}", words.empty() ? "" : "; ", xray.label.empty() ? "X-ray" : xray.label,
                         xray.acquired.empty() ? "at an unknown time" : xray.acquired);
  return words;
}

ResultsPage::Row row_of(const WaitingSession& waiting) {
  const std::string verdict = waiting.has_failed ? "failed" : "waiting";
  return {.verdict = verdict,
          .cells = {{.text = waiting.name},
                    {.text = waiting.patient_id},
                    {.text = waiting.acquired},
                    {.text = verdict},
                    {.text = ""},
                    {.text = waiting.why}}};
}

}  // namespace

std::string times_of(const std::vector<StudyFiles::Image>& images) { return times_in_words(images); }
std::string times_of(const std::vector<SetupResult::View>& views) { return times_in_words(views); }

void SessionIndex::add(const std::string& session, const SetupResult& report, const std::string& obstacle,
                       const std::string& reason_for_person) {
  std::string held = "held";
  if (!obstacle.empty())
    held += ", cannot be released: " + obstacle;
  else if (!reason_for_person.empty())
    held += " for a person: " + reason_for_person;
  Session added{.name = session,
                .patient = fmt::format("{} ({})", report.identity.patient_name, report.identity.patient_id),
                .verdict = std::string(to_string(report.verdict)),
                .action = std::string(to_string(shown_shift(report).decision.action)),
                .held = std::move(held),
                .state = "",
                .first = report.views.front().acquired,
                .times = times_of(report.views)};
  sessions_.insert(std::ranges::upper_bound(sessions_, added.first, std::ranges::greater(), &Session::first),
                   std::move(added));
  is_written_ = false;
}

// Whether any is another one now.
bool SessionIndex::update_states(const std::map<std::string, Objection>& objections) {
  bool has_changed = false;
  for (Session& session : sessions_) {
    if (session.is_over) continue;
    std::string state = session.held;
    const auto objection = objections.find(session.name);
    if (objection != objections.end()) state += "; " + objection->second.words;
    session.is_over = session.verdict == to_string(Verdict::kRejected);
    if (session.is_over) {
      state = "rejected";
    } else if (tree_.is_released(session.name)) {
      try {
        const Release release = tree_.release_of(session.name).value();
        const auto left = tree_.pending_of(release).size();
        session.is_over = left == 0;
        state = fmt::format("released by {} on {}{}", to_string(release.releaser), release.on,
                            release.despite.empty() ? "" : ", although " + release.despite);
        if (left > 0) state += fmt::format("; {} to be sent", left);
        if (left == 0 && !release.peers.empty()) state += "; sent";
      } catch (const std::exception& error) {
        state = error.what();
      }
    }
    has_changed |= std::exchange(session.state, state) != state;
  }
  return has_changed;
}

void SessionIndex::write(const std::string& page, const std::string& html) {
  std::string content = sha256_of(html);
  if (written_[page] == content) return;
  replace_text(tree_.path() / page, html);
  written_[page] = std::move(content);
}

void SessionIndex::update(const std::vector<WaitingSession>& waiting, const std::vector<std::string>& troubles,
                          const std::map<std::string, Objection>& objections) {
  const bool has_changed = update_states(objections);
  if (is_written_ && !has_changed && waiting == waiting_ && troubles == troubles_) return;
  is_written_ = false;  // until all of it is
  waiting_ = waiting;
  troubles_ = troubles;
  const std::string title = fmt::format("isoshift: sessions of {}", site_);
  ResultsPage newest{.title = title, .refresh_s = kRefreshS};
  newest.columns = {"Session", "Patient", "Acquired", "Verdict", "Action", "State"};
  newest.summary = {fmt::format(
      "{} sessions registered, {} waiting. A result is sent only after its release: by a person, with isoshift "
      "release SESSION --by NAME, or by the site's rule",
      sessions_.size(), waiting.size())};
  for (const std::string& trouble : troubles) newest.summary.push_back("Trouble: " + trouble);
  for (const WaitingSession& one : waiting) newest.rows.push_back(row_of(one));
  std::map<std::string, ResultsPage, std::greater<>> months;
  for (const Session& session : sessions_) {
    ResultsPage::Row row{.verdict = session.verdict,
                         .cells = {{.text = session.name, .link = "sessions/" + session.name + "/report.html"},
                                   {.text = session.patient},
                                   {.text = session.times},
                                   {.text = session.verdict},
                                   {.text = session.action},
                                   {.text = session.state}}};
    if (newest.rows.size() < waiting.size() + kNewest) newest.rows.push_back(row);
    const std::string month = month_of(session.first);
    ResultsPage& page = months[month];
    if (page.rows.empty()) {
      page.title = fmt::format("{}, {}", title, month);
      page.columns = newest.columns;
      page.pages = {{.text = "newest", .link = "index.html"}};
      newest.pages.push_back({.text = month, .link = page_of_month(month)});
    }
    page.rows.push_back(std::move(row));
  }
  for (const auto& [month, page] : months) write(page_of_month(month), results_html(page));
  write("index.html", results_html(newest));
  is_written_ = true;
}

}  // namespace isoshift
