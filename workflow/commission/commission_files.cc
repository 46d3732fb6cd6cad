#include "workflow/commission/commission_files.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "base/csv.h"
#include "base/json_file.h"
#include "base/version.h"
#include "geometry/motion_axes.h"
#include "io/report/canvas.h"
#include "io/report/report_page.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

// The names of those axes.
std::vector<std::string> axes_with(const Polarities& polarities, Outcome outcome, const CommissionWords& words) {
  std::vector<std::string> names;
  for (std::size_t axis = 0; axis < polarities.size(); ++axis)
    if (polarities[axis] == outcome) names.push_back(words.axes[axis]);
  return names;
}

std::string_view key_of(Known known) {
  switch (known) {
    case Known::kReadOuts: return "read-outs";
    case Known::kMoves: return "moves";
    case Known::kPositions: return "positions";
  }
  return "";
}

Json or_null(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json json_of(const std::optional<Share>& share) {
  if (!share) return nullptr;
  return {{"of", share->of}, {"total", share->total}, {"low", share->low}, {"high", share->high}};
}

Json json_of(const NamedResult& session) {
  const SetupResult& result = session.result;
  Json views = Json::array();
  std::set<std::string> machines;
  for (const SetupResult::View& view : result.views) {
    views.push_back(view.sha256);
    machines.insert(view.machine);
  }
  return {{"name", session.name},
          {"acquired", session.acquired()},
          {"verdict", to_string(result.verdict())},
          {"reasons", result.reasons()},
          {"program", {{"version", result.version}, {"commit", result.commit}}},
          {"preset", result.preset},
          {"machine_profile_sha256", result.machine ? Json(result.machine->sha256) : Json(nullptr)},
          {"radiation_machines", machines},
          {"ct_sha256", result.ct_sha256},
          {"xrays_sha256", views}};
}

std::string in_words(const Share& share) {
  return fmt::format("{} of {} ({:.0f} %, 95 % interval {:.0f} to {:.0f} %)", share.of, share.total,
                     100.0 * share.value(), 100.0 * share.low, 100.0 * share.high);
}

std::string in_words(const Calibration& calibration) {
  if (!calibration.within_one_sigma && !calibration.shared_sigmas)
    return "Untested: no error that counts has an uncertainty.";
  std::string words;
  if (calibration.within_one_sigma)
    words = fmt::format("One sigma holds {} of the errors, two sigma {}. Expected: 68 and 95 %. ",
                        in_words(*calibration.within_one_sigma), in_words(*calibration.within_two_sigma));
  if (calibration.shared_sigmas)
    words += fmt::format("The mean error, which holds that of the imagers, is at most {:.1f} sigma; limit {:.1f}. ",
                         *calibration.shared_sigmas, *calibration.shared_sigmas_limit);
  if (calibration.outcome == Outcome::kUntested) return words + "Untested: no two sessions can be compared.";
  if (calibration.outcome == Outcome::kPassed) return words + "Passed.";
  const bool is_shared = calibration.shared_sigmas && *calibration.shared_sigmas > *calibration.shared_sigmas_limit;
  return words + (is_shared ? "FAILED: the mean error is too large for the imagers' sigma."
                            : "FAILED: clearly fewer than expected.");
}

std::string row_of(const AxisOfLocalization& axis, Outcome polarity, const std::string& name, const char* unit) {
  if (!axis.errors) return fmt::format("  {:<22} {}\n", name, kNoErrors);
  const Agreement& errors = *axis.errors;
  const auto number = [](const std::optional<double>& value) { return value ? fmt::format("{:.3f}", *value) : "-"; };
  return fmt::format("  {:<22} {:>3} {:+8.2f} {:+8.2f} {:+8.3f} {:>7} {:>7} {:>8.3f} {:>3}  {:<9} {}\n", name,
                     errors.count, axis.least_known.value(), axis.most_known.value(), errors.bias,
                     number(errors.bias_within), number(errors.sd), axis.largest, unit, to_string(polarity),
                     to_string(axis.limit));
}

}  // namespace

CommissionWords words_of(const Commission& commission) {
  const Localization& localization = commission.localization;
  CommissionWords words{.title = "Commissioning of localization",
                        .outcome = {},
                        .known_from = {},
                        .axes = {"x (to the right)", "y (to the gantry)", "z (up)", "about x", "about y", "about z"},
                        .sigma = {},
                        .tested = {},
                        .untested = {}};
  switch (commission.outcome()) {
    case Outcome::kPassed: words.outcome = "PASSED: every test below, for what was tested"; break;
    case Outcome::kFailed: words.outcome = "FAILED: see the tests below"; break;
    case Outcome::kUntested:
      words.outcome = commission.limits ? "INCOMPLETE: nothing failed, but not everything was tested"
                                        : "INCOMPLETE: without a site file no error is too large";
      break;
  }
  switch (localization.known) {
    case Known::kReadOuts:
      words.known_from =
          fmt::format("read-outs of the table: moves from session {}", printable(localization.reference));
      break;
    case Known::kMoves:
      words.known_from = fmt::format("moves against session {}, as the site says", printable(localization.reference));
      break;
    case Known::kPositions: words.known_from = "positions that the site names"; break;
  }
  words.sigma = in_words(localization.calibration);
  const Coverage& coverage = commission.coverage;
  for (const auto& [condition, polarities] : localization.polarities)
    if (const auto moved = axes_with(polarities, Outcome::kPassed, words); !moved.empty())
      words.tested.push_back(fmt::format("{}: polarity of {}", condition, fmt::join(moved, ", ")));
  words.tested.push_back(
      fmt::format("gantry angles of a session's views, degrees: {}", fmt::join(coverage.view_angles, "; ")));
  words.tested.push_back(fmt::format("couch angles, degrees: {}", fmt::join(coverage.couch_deg, ", ")));
  std::vector<std::string> blind;
  for (std::size_t axis = 0; axis < localization.axes.size(); ++axis)
    if (!localization.axes[axis].errors) blind.push_back(words.axes[axis]);
  if (!blind.empty()) words.untested.push_back(fmt::format("axes {}: {}", kNoErrors, fmt::join(blind, ", ")));
  for (const auto& [condition, polarities] : localization.polarities)
    if (const auto unmoved = axes_with(polarities, Outcome::kUntested, words); !unmoved.empty())
      words.untested.push_back(
          fmt::format("{}: polarity of {}, since no known move reached 1 mm (1 degree) and ten "
                      "sigma of the move found",
                      condition, fmt::join(unmoved, ", ")));
  if (localization.known != Known::kPositions)
    words.untested.emplace_back("errors that all sessions share, such as those of a displaced imager (--positions)");
  if (const auto positions = coverage.untested_positions(); !positions.empty())
    words.untested.push_back(fmt::format("patient positions: {}", fmt::join(positions, ", ")));
  if (coverage.beams.size() < 2)
    words.untested.push_back(fmt::format("beams: {}", coverage.beams.contains("kV") ? "MV" : "kV"));
  words.untested.emplace_back("every other gantry angle, couch angle and combination of them");
  if (!commission.limits) words.untested.emplace_back("the site's limits: no site file was given (--site)");
  return words;
}

std::string commission_text(const Commission& commission) {
  const CommissionWords words = words_of(commission);
  std::string text =
      fmt::format("{}\n{}\n\n{}\n\nSessions     {} used, {} left out\nKnown from   {}\n", upper_case(words.title),
                  kDisclaimer, words.outcome, commission.sessions.size(), commission.left_out.size(), words.known_from);
  text += commission.limits ? fmt::format("Limits       {:g} mm along and {:g} degrees about any axis, of {}\n",
                                          commission.limits->translation_mm, commission.limits->rotation_deg,
                                          printable(commission.site_name))
                            : "Limits       none (--site)\n";
  for (const Commission::LeftOut& left : commission.left_out)
    text += fmt::format("  left out: {}: {}\n", printable(left.session), printable(left.why));
  text += fmt::format(
      "\nERRORS       (found against known, IEC 61217 fixed; +/- is the bias's 95 % interval)\n"
      "  {:<22} {:>3} {:>8} {:>8} {:>8} {:>7} {:>7} {:>8} {:>3}  {:<9} {}\n",
      "", "n", "from", "to", "bias", "+/-", "SD", "largest", "", "polarity", "limit");
  for (std::size_t axis = 0; axis < words.axes.size(); ++axis)
    text += row_of(commission.localization.axes[axis], commission.localization.polarity(axis), words.axes[axis],
                   unit_of(axis));
  text += fmt::format("\nUNCERTAINTY  {}\n\nTESTED\n", words.sigma);
  for (const std::string& line : words.tested) text += fmt::format("  - {}\n", line);
  text += "\nNOT TESTED\n";
  for (const std::string& line : words.untested) text += fmt::format("  - {}\n", line);
  return text;
}

std::string commission_csv(const Commission& commission) {
  std::string csv = "session,axis,unit,known,found,error,sigma\n";
  const auto number = [](const std::optional<double>& value) { return value ? fmt::format("{:.4f}", *value) : ""; };
  for (const Localized& one : commission.localization.all)
    for (std::size_t axis = 0; axis < one.error.size(); ++axis)
      csv += fmt::format("{},{},{},{},{},{},{}\n", csv_cell(one.session),
                         std::string_view(kErrorComponents[axis]).substr(0, is_rotation(axis) ? 2 : 1), unit_of(axis),
                         number(one.known[axis]), one.error[axis] ? fmt::format("{:.4f}", one.found[axis]) : "",
                         number(one.error[axis]), number(one.sigma[axis]));
  return csv;
}

std::string commission_json(const Commission& commission, const std::string& pdf_sha256,
                            const std::string& csv_sha256) {
  const Localization& localization = commission.localization;
  Json json = {{"schema", 1},
               {"program", {{"name", "isoshift"}, {"version", kVersion}, {"commit", kCommit}}},
               {"made_on", commission.made_on},
               {"by", commission.by.empty() ? Json(nullptr) : Json(commission.by)},
               {"outcome", to_string(commission.outcome())},
               {"known_from", key_of(localization.known)},
               {"known_poses_sha256",
                commission.known_poses_sha256.empty() ? Json(nullptr) : Json(commission.known_poses_sha256)},
               {"reference", localization.reference.empty() ? Json(nullptr) : Json(localization.reference)},
               {"site", nullptr},
               {"axes", Json::object()},
               {"uncertainty",
                {{"outcome", to_string(localization.calibration.outcome)},
                 {"within_one_sigma", json_of(localization.calibration.within_one_sigma)},
                 {"within_two_sigma", json_of(localization.calibration.within_two_sigma)},
                 {"shared_sigmas", or_null(localization.calibration.shared_sigmas)},
                 {"shared_sigmas_limit", or_null(localization.calibration.shared_sigmas_limit)}}},
               {"polarity", Json::object()},
               {"tested",
                {{"patient_positions", commission.coverage.patient_positions},
                 {"gantry_angles_deg", commission.coverage.view_angles},
                 {"couch_deg", commission.coverage.couch_deg},
                 {"beams", commission.coverage.beams}}},
               {"not_tested", words_of(commission).untested},
               {"sessions", Json::array()},
               {"left_out", Json::array()}};
  if (commission.limits)
    json["site"] = {
        {"name", commission.site_name},
        {"sha256", commission.site_sha256},
        {"limits",
         {{"translation_mm", commission.limits->translation_mm}, {"rotation_deg", commission.limits->rotation_deg}}}};
  for (const auto& [condition, polarities] : localization.polarities)
    for (std::size_t axis = 0; axis < polarities.size(); ++axis)
      json["polarity"][condition][kErrorComponents[axis]] = to_string(polarities[axis]);
  for (std::size_t axis = 0; axis < localization.axes.size(); ++axis) {
    const AxisOfLocalization& one = localization.axes[axis];
    Json& into = json["axes"][kErrorComponents[axis]];
    into = {{"polarity", to_string(localization.polarity(axis))},
            {"limit", to_string(one.limit)},
            {"known_from", or_null(one.least_known)},
            {"known_to", or_null(one.most_known)},
            {"count", 0}};
    if (!one.errors) continue;
    into["count"] = one.errors->count;
    into["bias"] = one.errors->bias;
    into["bias_95_percent"] = or_null(one.errors->bias_within);
    into["sd"] = or_null(one.errors->sd);
    into["largest"] = one.largest;
  }
  for (const NamedResult& session : commission.sessions) json["sessions"].push_back(json_of(session));
  for (const Commission::LeftOut& left : commission.left_out)
    json["left_out"].push_back({{"name", left.session}, {"why", left.why}});
  if (!pdf_sha256.empty()) json["files_sha256"] = {{"commission.pdf", pdf_sha256}, {"commission.csv", csv_sha256}};
  return json_text(json);
}

}  // namespace isoshift
