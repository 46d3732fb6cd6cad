#include "workflow/room/session_index.h"

#include <fmt/format.h>

#include <functional>

#include "base/output_folder.h"
#include "base/pattern.h"
#include "base/sha256.h"
#include "io/report/results_page.h"

namespace isoshift {
namespace {

constexpr std::size_t kNewest = 500;  // sessions in index.html
constexpr int kRefreshS = 10;

// "2026-03" of "2026-03-01 10:15:00".
std::string month_of(const std::string& acquired) {
  static const Pattern pattern("[0-9]{4}-[0-9]{2}");
  std::string month = acquired.substr(0, std::string_view("2026-03").size());
  return pattern.matches(month) ? month : "undated";
}

// A page's file, "sessions-2026-03.html".
std::string page_of_month(const std::string& month) { return "sessions-" + month + ".html"; }

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

void SessionIndex::add(const std::string& session, const SetupResult& report, const std::string& obstacle,
                       const std::string& reason_for_person) {
  list_.add(session, report, obstacle, reason_for_person);
  is_written_ = false;
}

void SessionIndex::remove(const std::string& first_session) {
  if (list_.remove(first_session)) is_written_ = false;
}

void SessionIndex::write(const std::string& page, const std::string& html) {
  std::string content = sha256_of(html);
  if (written_[page] == content) return;
  replace_text(tree_.path() / page, html);
  written_[page] = std::move(content);
}

// Pages of months of which all results were deleted name patients.
void SessionIndex::remove_pages_but(const std::set<std::string>& pages) {
  static const Pattern pattern("sessions-.*[.]html");
  std::vector<std::filesystem::path> others;
  for (const auto& entry : std::filesystem::directory_iterator(tree_.path()))
    if (const std::string page = entry.path().filename().string(); pattern.matches(page) && !pages.contains(page))
      others.push_back(entry.path());
  for (const std::filesystem::path& page : others) {
    std::filesystem::remove(page);
    written_.erase(page.filename().string());
  }
}

void SessionIndex::update(const std::vector<WaitingSession>& waiting, const std::vector<std::string>& troubles,
                          const std::map<std::string, Objection>& objections) {
  const bool has_changed = list_.update(objections);
  if (is_written_ && !has_changed && waiting == waiting_ && troubles == troubles_) return;
  is_written_ = false;  // until all of it is
  waiting_ = waiting;
  troubles_ = troubles;
  const std::string title = fmt::format("isoshift: sessions of {}", site_);
  ResultsPage newest{.title = title, .refresh_s = kRefreshS};
  newest.columns = {"Session", "Patient", "Acquired", "Verdict", "Action", "State"};
  newest.summary = {fmt::format(
      "{} sessions registered, {} waiting. A result is sent only after its release: by a person, with isoshift "
      "room release SESSION --by NAME, or by the site's rule",
      list_.sessions().size(), waiting.size())};
  for (const std::string& trouble : troubles) newest.summary.push_back("Trouble: " + trouble);
  for (const WaitingSession& one : waiting) newest.rows.push_back(row_of(one));
  std::map<std::string, ResultsPage, std::greater<>> months;
  for (const ListedSession& session : list_.sessions()) {
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
  std::set<std::string> pages;
  for (const auto& [month, page] : months) {
    pages.insert(page_of_month(month));
    write(page_of_month(month), results_html(page));
  }
  remove_pages_but(pages);
  write("index.html", results_html(newest));
  is_written_ = true;
}

}  // namespace isoshift
