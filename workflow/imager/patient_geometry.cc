#include "workflow/imager/patient_geometry.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "base/error.h"
#include "geometry/rotation.h"
#include "workflow/imager/imager_names.h"
#include "workflow/results_below.h"

namespace isoshift {
namespace {

// Why a result tells nothing of its imagers; empty: it does.
std::string why_left_out(const SetupResult& result) {
  const auto any_lacks = [&](const auto& has) { return !std::ranges::all_of(result.views, has); };
  if (result.verdict() == Verdict::kRejected) return "rejected";
  if (result.views.size() < 2) return "of a single view";
  if (result.translation_only) return "without rotations";
  if (!result.is_searched) return "set by hand, not searched";
  if (any_lacks([](const SetupResult::View& view) { return view.gantry_deg.has_value(); }))
    return "with X-rays that have no gantry angle";
  if (any_lacks([](const SetupResult::View& view) { return !view.is_receptor_corrected; }))
    return "corrected by a machine profile: they tell what is left, and not what the files lack";
  if (any_lacks([](const SetupResult::View& view) { return view.pixel_from_room && view.sid_mm; }))
    return "without the geometry of their X-rays (made by an earlier isoshift)";
  if (any_lacks(
          [](const SetupResult::View& view) { return view.match.wanted && view.match.wanted->covariance.allFinite(); }))
    return "without the motions that single views want (made by an earlier isoshift, or of views that determine none)";
  return "";
}

XrayView camera_of(const SetupResult::View& view) {
  return {.pixel_from_room = *view.pixel_from_room,
          .source_room_mm = view.source_room_mm,
          .columns = view.columns,
          .rows = view.rows,
          .beam = view.is_megavoltage ? Beam::kMegavoltage : Beam::kKilovoltage};
}

}  // namespace

PatientGeometry patient_geometry(const std::filesystem::path& results) {
  PatientGeometry geometry;
  std::vector<SetupResult> telling;
  std::set<std::string> cts;
  ResultsBelow below = results_below(results);
  require_distinct(below.results);
  if (!below.failed.empty()) geometry.left_out["that failed"] = below.failed.size();
  for (NamedResult& one : below.results) {
    if (const std::string why = why_left_out(one.result); !why.empty()) {
      ++geometry.left_out[why];
      continue;
    }
    cts.insert(one.result.ct_series_uid);
    telling.push_back(std::move(one.result));
  }
  if (telling.empty()) {
    std::string message = fmt::format("{}: no result tells anything of an imager:", results.string());
    for (const auto& [why, count] : geometry.left_out) message += fmt::format(" {} {};", count, why);
    message.back() = '.';
    throw Error(message);
  }
  ImagerNames imagers;
  std::vector<PatientSession> sessions;
  sessions.reserve(telling.size());
  for (const SetupResult& result : telling) {
    PatientSession& session = sessions.emplace_back();
    session.ct = result.ct_series_uid;
    for (const SetupResult::View& view : result.views)
      session.views.push_back(
          {.model = ImagerModel(camera_of(view), rad_from_deg(*view.gantry_deg), view.sid_mm.value()),
           .imager = imagers.number_of(view.is_megavoltage, view.machine),
           .wanted = *view.match.wanted});
    geometry.views += session.views.size();
  }
  geometry.imagers = imagers.names();
  geometry.sessions = sessions.size();
  geometry.cts = cts.size();
  geometry.found = imagers_of_patients(sessions, geometry.imagers.size());
  return geometry;
}

}  // namespace isoshift
