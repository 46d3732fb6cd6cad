#include "workflow/audit_setup/archive.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <set>
#include <utility>

#include "base/error.h"
#include "base/local_time.h"
#include "geometry/rotation.h"
#include "io/objects/spatial_registration.h"
#include "io/report/result_folder.h"
#include "setup/shown_shift.h"
#include "workflow/results_below.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

void set_found(const SetupResult& result, ComparedShift compared, AuditedSession& session) {
  const ShownShift shown = shown_shift(result);
  if (shown.withheld) return;
  session.setup_error = result.translation_only ? std::nullopt : complete_components(shown);
  const bool is_full = compared == ComparedShift::kFull;
  const Eigen::Matrix3d table_from_room = rotation_z(-result.table.yaw_rad());
  // Of yaw, pitch and roll: about z, x and y of the table top.
  constexpr std::array<Eigen::Index, 3> kAbout = {2, 0, 1};
  for (std::size_t n = 0; n < 3; ++n) {
    session.found[n] = is_full ? shown.couch_mm[n] : shown.applied_mm[n];
    session.sigma[n] = shown.couch_sigma_mm[n];
    if (result.translation_only || !(is_full || shown.can_rotate[n])) continue;
    session.found[n + 3] = shown.couch_deg[n];
    if (!result.uncertainty) continue;
    const Eigen::Matrix3d about_room_rad2 = result.uncertainty->covariance.bottomRightCorner<3, 3>();
    const Eigen::Matrix3d about_table_rad2 = table_from_room * about_room_rad2 * table_from_room.transpose();
    session.sigma[n + 3] = deg_from_rad(std::sqrt(about_table_rad2(kAbout[n], kAbout[n])));
  }
}

struct ReadSession {
  AuditedSession session;
  std::set<std::pair<std::string, int>> frames;  // of its X-rays: SOP Instance UID and number
  std::optional<double> made_on;                 // seconds of UTC; nothing: unknown
};

ReadSession read_session(const fs::path& folder, std::string name, ComparedShift compared) {
  ReadSession read{.session = {.name = std::move(name), .folder = folder}, .frames = {}, .made_on = {}};
  AuditedSession& session = read.session;
  try {
    const SetupResult result = read_report(folder);
    read.made_on = utc_seconds_at(result.made_on);
    session.verdict = result.verdict();
    session.reasons = result.reasons();
    session.identity = result.identity;
    session.ct_frame_uid = result.ct_frame_uid;
    for (const SetupResult::View& view : result.views) {
      session.xrays.insert(view.sop_instance_uid);
      read.frames.emplace(view.sop_instance_uid, view.frame);
      if (!view.acquired.empty() && (session.acquired.empty() || view.acquired < session.acquired))
        session.acquired = view.acquired;
    }
    set_found(result, compared, session);
    if (const auto position = patient_position_from(result.patient_position))
      session.planned = {.patient_position = *position,
                         .isocenter_patient_mm = result.isocenter_patient_mm,
                         .couch_angle_deg = deg_from_rad(result.table.yaw_rad()),
                         .couch_pitch_deg = deg_from_rad(result.table.pitch_rad),
                         .couch_roll_deg = deg_from_rad(result.table.roll_rad)};
    if (result.verdict() != Verdict::kAccepted)
      session.left_out = fmt::format("isoshift did not accept it ({})", to_string(result.verdict()));
    if (const auto seconds = seconds_at(session.acquired))
      session.day = *seconds / 86400.0;
    else if (session.counts())
      session.left_out = "the time of its X-rays is not known";
  } catch (const std::exception& error) {
    session.verdict.reset();
    session.left_out = error.what();
    session.xrays.clear();
    read.frames.clear();
  }
  return read;
}

// Of several results of an X-ray only the one made last counts.
void leave_out_earlier_results(std::vector<ReadSession>& all) {
  std::vector<ReadSession*> latest_first;
  latest_first.reserve(all.size());
  for (ReadSession& one : all) latest_first.push_back(&one);
  std::ranges::stable_sort(latest_first, std::greater(), &ReadSession::made_on);
  std::map<std::pair<std::string, int>, const ReadSession*> owners;
  for (ReadSession* one : latest_first) {
    const auto owned = std::ranges::find_if(one->frames, [&](const auto& frame) { return owners.contains(frame); });
    if (owned != one->frames.end())
      one->session.left_out =
          fmt::format("{} a later result: {}", one->frames.size() == 1 ? "its X-ray has" : "X-rays of it have",
                      owners.at(*owned)->session.name);
    for (const auto& frame : one->frames) owners.try_emplace(frame, one);
  }
}

// A session that does not count can be the first of its day, too: the couch may have been shifted after it.
void find_first_of_days(std::vector<AuditedSession>& sessions_by_time) {
  std::map<std::pair<std::string, double>, double> first;
  for (AuditedSession& session : sessions_by_time) {
    const std::pair patient_and_day(patient_key(session.identity), std::floor(session.day));
    session.is_first_of_day = first.try_emplace(patient_and_day, session.day).first->second == session.day;
  }
}

}  // namespace

CouchAxes AuditedSession::difference() const {
  CouchAxes off;
  for (std::size_t axis = 0; axis < off.size(); ++axis)
    if (used[axis] && found[axis]) {
      const double apart = *used[axis] - *found[axis];
      off[axis] = axis < 3 ? apart : std::remainder(apart, 360.0);
    }
  return off;
}

bool AuditedSession::is_compared() const {
  return counts() && std::ranges::any_of(difference(), [](const auto& off) { return off.has_value(); });
}

std::vector<AuditedSession> read_archive(const fs::path& folder, ComparedShift compared) {
  std::vector<ReadSession> all;
  for (const NamedFolder& one : result_folders_below(folder)) all.push_back(read_session(one.path, one.name, compared));
  leave_out_earlier_results(all);
  std::vector<AuditedSession> sessions;
  sessions.reserve(all.size());
  for (ReadSession& one : all) sessions.push_back(std::move(one.session));
  std::ranges::stable_sort(sessions, {}, &AuditedSession::day);
  find_first_of_days(sessions);
  return sessions;
}

}  // namespace isoshift
