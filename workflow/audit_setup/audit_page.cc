#include <fmt/format.h>

#include "geometry/motion_axes.h"
#include "io/report/results_page.h"
#include "workflow/audit_setup/audit_charts.h"
#include "workflow/audit_setup/audit_files.h"
#include "workflow/audit_setup/audit_words.h"

namespace isoshift {
namespace {

using Section = ResultsPage::Section;
using Cell = ResultsPage::Cell;

// A session, linked to its report.
Cell session_cell(const AuditedSession& session, const std::filesystem::path& place) {
  return {.text = session.name,
          .link = std::filesystem::proximate(session.folder / "report.html", place).generic_string()};
}

Section findings(const SetupAudit& audit, const std::filesystem::path& place) {
  Section section{.title = "What stands out"};
  if (audit.compared > 0) {
    for (const std::string& line : doubtful_axes(audit)) section.lines.push_back(line);
    for (const std::string& line : drifts_of_differences(audit))
      section.lines.push_back("Used minus found: " + line + ".");
  }
  for (const std::string& line : drifts_of_setup(audit)) section.lines.push_back("Setup error: " + line + ".");
  if (audit.compared == 0) return section;
  section.columns = {"Session", "Patient", "Acquired", "Explanation", "Axes"};
  for (const SetupAudit::Outlier& outlier : audit.outliers) {
    const AuditedSession& session = audit.sessions[outlier.session];
    section.rows.push_back({session_cell(session, place),
                            {.text = patient_in_words(session.identity)},
                            {.text = session.acquired},
                            {.text = outlier.explanation},
                            {.text = in_words(outlier, audit)}});
  }
  section.lines.push_back(fmt::format("Outliers: {}.", audit.outliers.empty() ? "none" : "the sessions of this table"));
  if (audit.outliers.empty()) section.columns.clear();
  section.remarks = {meaning_of_outliers(audit)};
  return section;
}

Section agreement(const SetupAudit& audit) {
  Section section{.title = "Agreement of used and found shifts",
                  .lines = {"Used minus found, along and about the table top's axes (IEC 61217). If isoshift is right, "
                            "this is where the used shift leaves the patient. Bias with 95 % confidence, 95 % limits "
                            "of agreement: bias -/+ 1.96 SD (Bland and Altman, 1986). A drift is part of the SD."},
                  .columns = {"Axis", "Sessions", "Bias", "±", "SD", "Limit", "Limit", "Bias of all", "SD of all"}};
  for (std::size_t n = 0; n < audit.axes.size(); ++n) {
    const SetupAudit::Axis& axis = audit.axes[n];
    if (!axis.without_outliers) continue;
    const Agreement &some = *axis.without_outliers, &all = *axis.of_all;
    const auto limit = [&](double side) {
      return some.limit ? std::optional(some.bias + side * *some.limit) : std::nullopt;
    };
    section.rows.push_back({{.text = fmt::format("{}, {}", kCouchAxes[n], unit_of(n))},
                            number_cell(static_cast<double>(some.count), 0),
                            number_cell(some.bias, 2),
                            number_cell(some.bias_within, 2),
                            number_cell(some.sd, 2),
                            number_cell(limit(-1.0), 2),
                            number_cell(limit(1.0), 2),
                            number_cell(all.bias, 2),
                            number_cell(all.sd, 2)});
  }
  section.charts_svg = agreement_charts(audit);
  section.remarks = {
      "Crosses are outliers, and arrows are outliers beyond the chart, with their value: they are in the last two "
      "columns of the table and in nothing else."};
  return section;
}

template <class Names>
void add_drift_table(const std::array<std::optional<Drift>, 6>& drifts, const Names& names, Section& section) {
  section.columns = {"Axis", "Slope per 30 days", "±", "p", "Change"};
  for (std::size_t n = 0; n < drifts.size(); ++n)
    if (const auto& drift = drifts[n])
      section.rows.push_back({{.text = fmt::format("{}, {}", names[n], unit_of(n))},
                              number_cell(drift->slope, 3),
                              number_cell(drift->slope_within, 3),
                              {.text = fmt::format("{:.2g}", drift->p), .number = drift->p},
                              {.text = drift->is_significant() ? in_words(*drift, n) : "none is significant"}});
}

Section difference_drift(const SetupAudit& audit) {
  Section section{.title = "Drift of the differences",
                  .lines = {"A drift of used minus found can be a change of the machine or of the method: the "
                            "isocenter of the imager that the clinic used against that of the X-rays, the couch or "
                            "its read-outs, software, or how people match. Outliers are not drawn."}};
  std::array<std::optional<Drift>, 6> drifts;
  for (std::size_t n = 0; n < drifts.size(); ++n) drifts[n] = audit.axes[n].drift;
  add_drift_table(drifts, kCouchAxes, section);
  section.charts_svg = difference_charts(audit);
  section.remarks = {kMeaningOfDrift};
  return section;
}

Section setup_drift(const SetupAudit& audit) {
  Section section{.title = "Drift of the setup error",
                  .lines = {"Where patients lay before the shift, as isoshift found it: the first session of a day, "
                            "room axes (IEC 61217 fixed). A drift can be lasers, immobilization, habits, the mix of "
                            "patients, or a change of the X-rays' isocenter. Patients differ by Sigma, so that few "
                            "patients tell little about it."}};
  add_drift_table(audit.setup_drift, kSetupAxes, section);
  section.charts_svg = setup_charts(audit);
  return section;
}

Section margins(const SetupAudit& audit) {
  Section section{.title = "Systematic and random errors, margins",
                  .columns = {"", "Patients", "M, mm", "Σ, mm", "σ, mm", "Margin, mm"},
                  .remarks = {kMeaningOfMargins}};
  const auto add = [&](const char* what, const std::optional<SetupAudit::Population>& population,
                       const std::array<const char*, 3>& axes) {
    for (std::size_t n = 0; population && n < axes.size(); ++n)
      section.rows.push_back({{.text = fmt::format("{}, {}", what, axes[n])},
                              number_cell(static_cast<double>(population->errors.patients), 0),
                              number_cell(population->errors.mean[n], 2),
                              number_cell(population->errors.systematic[n], 2),
                              number_cell(population->errors.random[n], 2),
                              number_cell(population->margin_mm[n], 1)});
    if (!population)
      section.lines.push_back(fmt::format("{}: not known; two patients with two sessions are needed.", what));
  };
  add("Without imaging", audit.uncorrected, {"x", "y", "z"});
  if (audit.compared > 0)
    add("After the used shifts, without outliers", audit.corrected, {"lateral", "longitudinal", "vertical"});
  return section;
}

}  // namespace

std::string audit_html(const SetupAudit& audit, const std::filesystem::path& place) {
  ResultsPage page{.title = "isoshift qa audit-setup",
                   .summary = {counts_of(audit) + ".", "Not for clinical use unless validated by the site."}};
  page.sections.push_back(findings(audit, place));
  if (audit.compared > 0) {
    page.sections.push_back(agreement(audit));
    page.sections.push_back(difference_drift(audit));
  }
  page.sections.push_back(setup_drift(audit));
  page.sections.push_back(margins(audit));
  if (!audit.of_no_use.empty()) page.sections.push_back({.title = "Files of no use", .lines = audit.of_no_use});
  page.sections.push_back({.title = "All sessions", .lines = {"Used minus found, in mm and degrees."}});
  page.columns = {"Session", "Patient", "Acquired", "Verdict"};
  for (const char* axis : kCouchAxes) page.columns.emplace_back(axis);
  page.columns.emplace_back("Remark");
  for (std::size_t n = 0; n < audit.sessions.size(); ++n) {
    const AuditedSession& session = audit.sessions[n];
    ResultsPage::Row row{.verdict = session.verdict_in_words(),
                         .cells = {session_cell(session, place),
                                   {.text = patient_in_words(session.identity)},
                                   {.text = session.acquired},
                                   {.text = session.verdict_in_words()}}};
    const CouchAxes difference = session.difference();
    for (std::size_t axis = 0; axis < difference.size(); ++axis)
      row.cells.push_back(number_cell(difference[axis], is_rotation(axis) ? 2 : 1));
    row.cells.push_back({.text = remark_on(n, audit)});
    page.rows.push_back(std::move(row));
  }
  return results_html(page);
}

}  // namespace isoshift
