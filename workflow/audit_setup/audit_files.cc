#include "workflow/audit_setup/audit_files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <nlohmann/json.hpp>
#include <vector>

#include "base/csv.h"
#include "base/json_file.h"
#include "base/output_folder.h"
#include "base/version.h"
#include "workflow/audit_setup/audit_words.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

Json json_of(const CouchAxes& axes) {
  Json json;
  for (std::size_t n = 0; n < axes.size(); ++n) json[kCouchColumns[n]] = axes[n] ? Json(*axes[n]) : Json(nullptr);
  return json;
}

Json json_of(const std::optional<Agreement>& agreement) {
  if (!agreement) return nullptr;
  Json json = {{"sessions", agreement->count}, {"bias", agreement->bias}};
  json["bias_within"] = agreement->bias_within ? Json(*agreement->bias_within) : Json(nullptr);
  json["sd"] = agreement->sd ? Json(*agreement->sd) : Json(nullptr);
  json["limits"] =
      agreement->limit ? Json{agreement->bias - *agreement->limit, agreement->bias + *agreement->limit} : Json(nullptr);
  return json;
}

Json json_of(const std::optional<Drift>& drift) {
  if (!drift) return nullptr;
  const bool is_step = drift->shape == DriftShape::kStep;
  return {{"is_significant", drift->is_significant()},
          {"p", drift->p},
          {"slope_per_30_days", drift->slope},
          {"slope_within", drift->slope_within},
          {"shape", is_step ? "step" : "line"},
          {"step", is_step ? Json(drift->change) : Json(nullptr)},
          {"step_within", is_step ? Json(drift->change_within) : Json(nullptr)},
          {"step_on", is_step ? Json(date_of(drift->begins)) : Json(nullptr)}};
}

Json json_of(const std::optional<SetupAudit::Population>& population, const std::array<const char*, 3>& axes) {
  if (!population) return nullptr;
  Json json = {{"patients", population->errors.patients}};
  for (std::size_t n = 0; n < axes.size(); ++n)
    json[axes[n]] = {{"mean", population->errors.mean[n]},
                     {"systematic", population->errors.systematic[n]},
                     {"random", population->errors.random[n]},
                     {"margin", population->margin_mm[n]}};
  return json;
}

Json session_json(const SetupAudit& audit, std::size_t n) {
  const AuditedSession& session = audit.sessions[n];
  Json json = {{"session", session.name},
               {"patient_id", session.identity.patient_id},
               {"patient_id_issuer", session.identity.patient_id_issuer},
               {"acquired", session.acquired},
               {"verdict", session.verdict_in_words()},
               {"reasons", session.reasons},
               {"counts", session.counts()},
               {"left_out", session.left_out},
               {"found", json_of(session.found)},
               {"used", json_of(session.used)},
               {"used_from", session.used_from},
               {"not_compared", session.not_compared},
               {"difference", json_of(session.difference())},
               {"expected_difference", json_of(audit.level[n])},
               {"sigma", json_of(session.sigma)},
               {"outlier", nullptr}};
  if (const SetupAudit::Outlier* outlier = audit.outlier_of(n)) {
    Json axes = Json::array();
    for (const std::size_t axis : outlier->axes) axes.push_back(kCouchAxes[axis]);
    json["outlier"] = {{"axes", axes}, {"explanation", outlier->explanation}};
  }
  return json;
}

}  // namespace

std::string audit_json(const SetupAudit& audit) {
  Json json = {{"schema", 1},
               {"program", {{"name", "isoshift"}, {"version", kVersion}, {"commit", kCommit}}},
               {"made_on", audit.made_on},
               {"used_sha256", audit.used_sha256.empty() ? Json(nullptr) : Json(audit.used_sha256)},
               {"counted", audit.counted},
               {"compared", audit.compared},
               {"patients", audit.patients},
               {"outliers", audit.outliers.size()},
               {"outlier_threshold_sd", audit.threshold},
               {"agreement", Json::object()},
               {"setup_error_drift", Json::object()},
               {"as_set_up", json_of(audit.uncorrected, {"x_mm", "y_mm", "z_mm"})},
               {"after_used_shifts", json_of(audit.corrected, {"lateral_mm", "longitudinal_mm", "vertical_mm"})},
               {"sessions", Json::array()},
               {"of_no_use", audit.of_no_use}};
  for (std::size_t n = 0; n < audit.axes.size(); ++n) {
    const SetupAudit::Axis& axis = audit.axes[n];
    json["agreement"][kCouchColumns[n]] = {{"without_outliers", json_of(axis.without_outliers)},
                                           {"of_all", json_of(axis.of_all)},
                                           {"scatter", axis.scatter},
                                           {"looks_opposite", axis.looks_opposite},
                                           {"looks_unrelated", axis.looks_unrelated},
                                           {"drift", json_of(axis.drift)}};
    json["setup_error_drift"][kErrorComponents[n]] = json_of(audit.setup_drift[n]);
  }
  for (std::size_t n = 0; n < audit.sessions.size(); ++n) json["sessions"].push_back(session_json(audit, n));
  return json_text(json);
}

std::string audit_csv(const SetupAudit& audit, const std::filesystem::path& place) {
  std::string csv = "session,patient_id,patient_id_issuer,acquired,verdict,counted,outlier,remark";
  for (const char* kind : {"found", "used", "difference", "sigma"})
    for (const char* column : kCouchColumns) csv += fmt::format(",{}_{}", kind, column);
  csv += ",report\n";
  for (std::size_t n = 0; n < audit.sessions.size(); ++n) {
    const AuditedSession& session = audit.sessions[n];
    csv += fmt::format("{},{},{},{},{},{},{},{}", csv_cell(session.name), csv_cell(session.identity.patient_id),
                       csv_cell(session.identity.patient_id_issuer), session.acquired, session.verdict_in_words(),
                       session.counts() ? "yes" : "no", audit.outlier_of(n) != nullptr ? "yes" : "no",
                       csv_cell(remark_on(n, audit)));
    for (const CouchAxes& axes : {session.found, session.used, session.difference(), session.sigma})
      for (const std::optional<double>& value : axes) csv += value ? fmt::format(",{:.4f}", *value) : ",";
    csv += "," + csv_cell(std::filesystem::proximate(session.folder, place).string()) + "\n";
  }
  return csv;
}

void write_audit(const SetupAudit& audit, const std::filesystem::path& used, const std::filesystem::path& folder,
                 bool overwrite) {
  std::vector<std::filesystem::path> inputs = {used};
  for (const AuditedSession& session : audit.sessions) inputs.push_back(session.folder);
  OutputFolder output(folder, overwrite, inputs);
  // proximate() finds no way to a relative path of which nothing exists.
  const std::filesystem::path place = std::filesystem::absolute(folder);
  write_text(output.path() / "audit.csv", audit_csv(audit, place));
  write_text(output.path() / "audit.json", audit_json(audit));
  write_text(output.path() / "audit.html", audit_html(audit, place));
  output.commit();
}

}  // namespace isoshift
