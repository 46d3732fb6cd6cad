#include "workflow/batch/batch_summary.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/csv.h"
#include "base/json_file.h"
#include "base/output_folder.h"
#include "io/report/line_chart.h"
#include "io/report/result_folder.h"
#include "io/report/results_page.h"
#include "setup/shown_shift.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

std::string status_of(const CaseEnd& end) {
  if (end.report) return std::string(to_string(end.report->verdict()));
  return end.error.empty() ? "open" : "failed";
}

std::string acquired(const CaseEnd& end) {
  return end.report && !end.report->views.empty() ? end.report->views.front().acquired : "";
}

// Why a case was not accepted, on one line.
std::string reason_of(const CaseEnd& end) {
  std::string text = end.report ? fmt::format("{}", fmt::join(end.report->reasons(), "; ")) : end.error;
  std::ranges::replace(text, '\n', ' ');
  return text;
}

using Components = std::array<std::optional<double>, 6>;

std::string summary_csv(const BatchSummary& summary) {
  std::string csv = fmt::format("case,patient_id,acquired,verdict,action,{},reason,seconds,report\n",
                                fmt::join(kErrorComponents, ","));
  for (const CaseEnd& end : summary.cases) {
    std::string components(5, ',');
    if (end.report) {
      std::vector<std::string> texts;
      for (const auto& component : shown_components(shown_shift(*end.report)))
        texts.push_back(component ? fmt::format("{:.4f}", *component) : "");
      components = fmt::format("{}", fmt::join(texts, ","));
    }
    csv += fmt::format("{},{},{},{},{},{},{},{},{}\n", end.name,
                       end.report ? csv_cell(end.report->identity.patient_id) : "", acquired(end), status_of(end),
                       end.report ? to_string(shown_shift(*end.report).decision.action) : "", components,
                       csv_cell(reason_of(end)), end.report ? fmt::format("{:.3f}", end.report->seconds_total) : "",
                       end.report ? fmt::format("cases/{}/report.pdf", end.name) : "");
  }
  return csv;
}

std::vector<std::string> component_titles() {
  return {"x, mm", "y, mm", "z, mm", "about x, °", "about y, °", "about z, °"};
}

std::string counts_in_words(const BatchSummary& summary) {
  std::map<std::string, std::size_t> counts;
  for (const CaseEnd& end : summary.cases) ++counts[status_of(end)];
  std::string text = fmt::format("{} cases: {} accepted", summary.cases.size(), counts["accepted"]);
  for (const char* status : {"review", "rejected", "failed", "open"})
    if (counts[status] > 0) text += fmt::format(", {} {}", counts[status], status);
  return text;
}

std::vector<std::string> population_in_words(const BatchSummary& summary) {
  if (!summary.population) return {};
  const auto line = [](const char* what, const ErrorComponents& c) {
    return fmt::format("{}: {:.2f}, {:.2f}, {:.2f} mm along x, y, z; {:.2f}, {:.2f}, {:.2f}° about them", what, c[0],
                       c[1], c[2], c[3], c[4], c[5]);
  };
  return {fmt::format("Setup errors of {} patients with two accepted fractions or more (IEC 61217 fixed)",
                      summary.population->patients),
          line("Mean (M)", summary.population->mean), line("Systematic (Σ)", summary.population->systematic),
          line("Random (σ)", summary.population->random)};
}

std::string index_html(const BatchSummary& summary) {
  ResultsPage page{.title = "isoshift batch", .summary = {counts_in_words(summary)}};
  for (std::string& line : population_in_words(summary)) page.summary.push_back(std::move(line));
  page.columns = {"Case", "Patient", "Acquired", "Verdict", "Action"};
  for (const std::string& title : component_titles()) page.columns.push_back(title);
  page.columns.emplace_back("Reason");
  for (const CaseEnd& end : summary.cases) {
    ResultsPage::Row row{
        .verdict = status_of(end),
        .cells = {
            {.text = end.name, .link = end.report ? "cases/" + end.name + "/report.html" : ""},
            {.text = end.report ? end.report->identity.patient_id : "", .link = end.report ? "patients.html" : ""},
            {.text = acquired(end)},
            {.text = status_of(end)},
            {.text = end.report ? std::string(to_string(shown_shift(*end.report).decision.action)) : ""}}};
    const Components components = end.report ? shown_components(shown_shift(*end.report)) : Components();
    for (std::size_t n = 0; n < components.size(); ++n) row.cells.push_back(number_cell(components[n], n < 3 ? 1 : 2));
    row.cells.push_back({.text = reason_of(end)});
    page.rows.push_back(std::move(row));
  }
  return results_html(page);
}

std::string chart_of(const PatientErrors& patient) {
  LineChart chart{
      .title = patient.patient, .x_label = "accepted fraction", .y_label = "mm", .curves = {}, .from_zero = false};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    LineChart::Curve curve{.name = std::string(1, "xyz"[axis]), .points = {}};
    for (std::size_t n = 0; n < patient.fractions.size(); ++n)
      curve.points.emplace_back(static_cast<double>(n + 1), patient.fractions[n][axis]);
    chart.curves.push_back(std::move(curve));
  }
  return line_chart_svg(chart, 400.0, 240.0);
}

std::string patients_html(const BatchSummary& summary) {
  constexpr std::size_t kMostCharts = 24;
  ResultsPage page{.title = "Setup errors by patient", .summary = population_in_words(summary)};
  page.summary.emplace_back(
      "Systematic: mean over the accepted fractions. Random: their standard deviation. IEC 61217 fixed.");
  page.columns = {"Patient", "Fractions"};
  for (const char* kind : {"systematic", "random"})
    for (const std::string& title : component_titles()) page.columns.push_back(fmt::format("{} {}", kind, title));
  for (const PatientErrors& patient : summary.patients) {
    ResultsPage::Row row{.verdict = "accepted", .cells = {{.text = patient.patient}}};
    row.cells.push_back(number_cell(static_cast<double>(patient.fractions.size()), 0));
    for (std::size_t n = 0; n < 6; ++n) row.cells.push_back(number_cell(patient.mean[n], 2));
    for (std::size_t n = 0; n < 6; ++n)
      row.cells.push_back(number_cell(patient.sd ? std::optional((*patient.sd)[n]) : std::nullopt, 2));
    page.rows.push_back(std::move(row));
    if (patient.sd && page.charts_svg.size() < kMostCharts) page.charts_svg.push_back(chart_of(patient));
  }
  return results_html(page);
}

CaseEnd end_of(const BatchFolder& folder, const std::string& name) {
  CaseEnd end{.name = name, .report = std::nullopt, .error = ""};
  if (!folder.has_ended(name)) return end;
  if (std::filesystem::exists(folder.folder_of(name) / kErrorFile)) {
    end.error = read_json_file(folder.folder_of(name) / kErrorFile).json.value("error", "unknown");
    return end;
  }
  end.report = read_report(folder.folder_of(name));
  return end;
}

}  // namespace

std::size_t BatchSummary::accepted() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(cases, [](const CaseEnd& end) { return status_of(end) == "accepted"; }));
}

std::size_t BatchSummary::open() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(cases, [](const CaseEnd& end) { return status_of(end) == "open"; }));
}

BatchSummary summary_of(const BatchFolder& folder, const std::vector<BatchCase>& cases) {
  BatchSummary summary;
  struct OfPatient {
    std::string words;
    std::multimap<std::string, ErrorComponents> fractions;  // by the time of acquisition
  };
  std::map<std::string, OfPatient> by_patient;  // by patient_key()
  for (const BatchCase& one : cases) {
    summary.cases.push_back(end_of(folder, one.name));
    const CaseEnd& end = summary.cases.back();
    if (!end.report || end.report->verdict() != Verdict::kAccepted) continue;
    const auto components = complete_components(shown_shift(*end.report));
    if (!components) continue;
    OfPatient& patient = by_patient[patient_key(end.report->identity)];
    patient.words = patient_in_words(end.report->identity);
    patient.fractions.emplace(acquired(end), *components);
  }
  for (const auto& [key, patient] : by_patient) {
    std::vector<ErrorComponents> in_order;
    in_order.reserve(patient.fractions.size());
    for (const auto& [at, error] : patient.fractions) in_order.push_back(error);
    summary.patients.push_back(errors_of_patient(patient.words, std::move(in_order)));
  }
  summary.population = errors_of_population(summary.patients);
  return summary;
}

std::string summary_json(const BatchSummary& summary) {
  Json cases = Json::array(), patients = Json::array();
  for (const CaseEnd& end : summary.cases) {
    Json json = {{"case", end.name}, {"status", status_of(end)}};
    if (end.report) {
      json["patient_id"] = end.report->identity.patient_id;
      json["acquired"] = acquired(end);
      json["action"] = to_string(shown_shift(*end.report).decision.action);
      Json components = Json::object();
      const Components shown = shown_components(shown_shift(*end.report));
      for (std::size_t n = 0; n < 6; ++n) components[kErrorComponents[n]] = shown[n] ? Json(*shown[n]) : Json(nullptr);
      json["setup_error"] = components;
      json["reasons"] = end.report->reasons();
      json["seconds"] = {
          {"load", end.report->seconds_load}, {"register", end.report->seconds}, {"total", end.report->seconds_total}};
    } else if (!end.error.empty()) {
      json["error"] = end.error;
    }
    cases.push_back(std::move(json));
  }
  for (const PatientErrors& patient : summary.patients) {
    Json json = {
        {"patient_id", patient.patient}, {"fractions", patient.fractions.size()}, {"systematic", patient.mean}};
    json["random"] = patient.sd ? Json(*patient.sd) : Json(nullptr);
    patients.push_back(std::move(json));
  }
  Json json = {{"schema", 1}, {"components", kErrorComponents}, {"cases", cases}, {"patients", patients}};
  json["population"] = nullptr;
  if (summary.population)
    json["population"] = {{"patients", summary.population->patients},
                          {"mean", summary.population->mean},
                          {"systematic", summary.population->systematic},
                          {"random", summary.population->random}};
  return json_text(json);
}

std::string summary_text(const BatchSummary& summary) {
  std::string text = counts_in_words(summary) + "\n";
  for (const CaseEnd& end : summary.cases)
    if (const std::string status = status_of(end); status != "accepted" && status != "open")
      text += fmt::format("  {:<14} {:<9} {}\n", end.name, status, reason_of(end));
  for (const std::string& line : population_in_words(summary)) text += line + "\n";
  return text;
}

void write_summary(const BatchFolder& folder, const BatchSummary& summary) {
  replace_text(folder.path() / "summary.csv", summary_csv(summary));
  replace_text(folder.path() / "summary.json", summary_json(summary));
  replace_text(folder.path() / "patients.html", patients_html(summary));
  replace_text(folder.path() / "index.html", index_html(summary));
}

}  // namespace isoshift
