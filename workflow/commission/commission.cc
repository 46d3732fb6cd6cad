#include "workflow/commission/commission.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/local_time.h"
#include "base/output_folder.h"
#include "base/sha256.h"
#include "base/signing_key.h"
#include "geometry/rotation.h"
#include "io/config/site_file.h"
#include "workflow/commission/commission_files.h"
#include "workflow/results_below.h"

namespace isoshift {
namespace {

int whole_degrees(double deg) {
  constexpr int kTurn = 360;
  return (static_cast<int>(std::lround(deg)) % kTurn + kTurn) % kTurn;
}

// What a commissioning is of. Throws Error naming two sessions that differ in it.
void check_alike(const std::vector<NamedResult>& sessions, Known known) {
  const auto machines_of = [](const SetupResult& result) {
    std::set<std::string> machines;
    for (const SetupResult::View& view : result.views)
      machines.insert(view.machine.empty() ? "(no name)" : view.machine);
    return fmt::format("{}", fmt::join(machines, ", "));
  };
  const auto check = [&](const char* of_what, const auto& what) {
    for (const auto& [name, result] : sessions)
      if (const std::string here = what(result), first = what(sessions.front().result); here != first)
        throw Error(fmt::format("sessions {} and {} differ in their {}: {} and {}. A commissioning is of one",
                                sessions.front().name, name, of_what, first, here));
  };
  check("Radiation Machine Name", machines_of);
  check("program",
        [](const SetupResult& result) { return fmt::format("isoshift {} ({})", result.version, result.commit); });
  check("preset", [](const SetupResult& result) { return result.preset; });
  check("machine profile", [](const SetupResult& result) { return result.machine ? result.machine->sha256 : "none"; });
  if (known != Known::kPositions)
    check("CT, against which moves are measured",
          [](const SetupResult& result) { return "SHA-256 " + result.ct_sha256; });
}

Coverage coverage_of(const std::vector<NamedResult>& sessions) {
  Coverage coverage;
  for (const auto& [name, result] : sessions) {
    coverage.patient_positions.insert(result.patient_position);
    coverage.couch_deg.insert(whole_degrees(deg_from_rad(result.table.yaw_rad())));
    std::set<int> angles;
    bool has_matrix = false;
    for (const SetupResult::View& view : result.views) {
      coverage.beams.insert(view.is_megavoltage ? "MV" : "kV");
      if (view.gantry_deg)
        angles.insert(whole_degrees(*view.gantry_deg));
      else
        has_matrix = true;
    }
    coverage.view_angles.insert(has_matrix ? "by matrix" : fmt::format("{}", fmt::join(angles, "/")));
  }
  return coverage;
}

// Whether the columns of the table hold what they say.
void check_table(const KnownPoses& poses, const Localization& localization, const std::filesystem::path& table) {
  std::vector<StatedAndFound> sessions;
  for (const Localized& one : localization.all) {
    StatedAndFound& compared = sessions.emplace_back();
    compared.name = one.session;
    for (std::size_t axis = 0; axis < one.found.size(); ++axis) {
      if (!one.error[axis]) continue;
      compared.stated[axis] = one.known[axis];
      compared.found[axis] = one.found[axis];
    }
  }
  check_columns(poses.columns, sessions, table.string());
}

}  // namespace

std::set<std::string> Coverage::untested_positions() const {
  std::set<std::string> untested;
  for (const PatientPosition position : kPatientPositions)
    if (!patient_positions.contains(std::string(to_string(position)))) untested.emplace(to_string(position));
  return untested;
}

Outcome Commission::outcome() const {
  std::vector<Outcome> all = {localization.calibration.outcome};
  for (const AxisOfLocalization& axis : localization.axes) all.push_back(axis.limit);
  for (const auto& [condition, polarities] : localization.polarities)
    all.insert(all.end(), polarities.begin(), polarities.end());
  if (!left_out.empty() || std::ranges::count(all, Outcome::kFailed) > 0) return Outcome::kFailed;
  return std::ranges::count(all, Outcome::kUntested) > 0 ? Outcome::kUntested : Outcome::kPassed;
}

Commission commission_of(const CommissionRequest& request) {
  Commission commission{.made_on = local_time(), .by = request.by};
  if (!request.site.empty()) {
    const SiteFile site = read_site_file(request.site);
    if (!site.localization_limits)
      throw Error(
          fmt::format("{}: has no localization_limits; expected {{\"translation_mm\": 1, \"rotation_deg\": "
                      "0.5}} with the site's own numbers",
                      request.site.string()));
    commission.limits = site.localization_limits;
    commission.site_name = site.name;
    commission.site_sha256 = site.sha256;
  }
  KnownPoses known_poses;
  if (request.known != Known::kReadOuts) {
    known_poses = read_known_poses(request.known_poses);
    commission.known_poses_sha256 = known_poses.sha256;
  }
  ResultsBelow found = results_below(request.results);
  for (const auto& [name, message] : found.failed)
    commission.left_out.push_back({.session = name, .why = "registration failed: " + message});
  require_distinct(found.results);
  for (NamedResult& one : found.results) {
    if (!one.result.is_searched)
      commission.left_out.push_back({.session = one.name, .why = "its pose was set, not searched"});
    else if (one.result.verdict() != Verdict::kRejected)
      commission.sessions.push_back(std::move(one));
    else
      commission.left_out.push_back(
          {.session = one.name, .why = fmt::format("rejected: {}", fmt::join(one.result.reasons(), "; "))});
  }
  if (commission.sessions.empty()) {
    std::string message = fmt::format("{}: no result can be used:", request.results.string());
    for (const auto& [name, why] : commission.left_out) message += fmt::format("\n       {}: {}", name, why);
    throw Error(message);
  }
  check_alike(commission.sessions, request.known);
  // Their known poses have no result; that is said with the sessions.
  for (const auto& [name, why] : commission.left_out) known_poses.by_session.erase(name);
  commission.coverage = coverage_of(commission.sessions);
  commission.localization = localization_of(commission.sessions, request.known, known_poses, commission.limits);
  if (request.known != Known::kReadOuts) check_table(known_poses, commission.localization, request.known_poses);
  return commission;
}

void write_commission(const Commission& commission, const CommissionRequest& request) {
  std::optional<SigningKey> key;
  if (!request.key.empty()) key.emplace(request.key);
  std::vector<std::filesystem::path> inputs = {request.known_poses, request.site, request.key};
  for (const NamedFolder& result : result_folders_below(request.results)) inputs.push_back(result.path);
  OutputFolder output(request.output, request.overwrite, inputs);
  const std::string pdf = commission_pdf(commission, key.has_value()), csv = commission_csv(commission);
  const std::string json = commission_json(commission, sha256_of(pdf), sha256_of(csv));
  write_text(output.path() / "commission.pdf", pdf);
  write_text(output.path() / "commission.csv", csv);
  write_text(output.path() / "commission.json", json);
  if (key) write_text(output.path() / "commission.json.sig", key->signature_of(json));
  output.commit();
}

}  // namespace isoshift
