#include "workflow/imager/ball_geometry.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "base/median.h"
#include "geometry/rotation.h"
#include "registration/preprocess/preprocess.h"
#include "workflow/commission/known_poses.h"
#include "workflow/imager/imager_names.h"
#include "workflow/register/setup_result_of.h"

namespace isoshift {
namespace {

std::string name_of_session(const std::filesystem::path& folder) {
  return std::filesystem::absolute(folder / "").lexically_normal().parent_path().filename().string();
}

double median_radius_mm(const std::vector<Ball>& balls) {
  std::vector<double> radii;
  radii.reserve(balls.size());
  for (const Ball& ball : balls) radii.push_back(ball.radius_mm);
  return median(radii);
}

BallSession session_of(const std::string& name, const Study& study, double radius_mm, ImagerNames& imagers) {
  BallSession session{.name = name,
                      .planned_room_from_patient = study.planned_room_from_patient,
                      .known_setup_error = Eigen::Isometry3d::Identity(),
                      .views = {}};
  for (std::size_t n = 0; n < study.xrays.size(); ++n) {
    const RtImage& header = study.rt_images[n];
    const XrayImage& xray = study.xrays[n];
    if (!header.gantry_angle_deg || header.pixel_from_room)
      throw Error(
          fmt::format("session {}: {} has no gantry angle: only imagers on a gantry are understood", name, xray.label));
    if (header.imager && header.imager->is_corrected)
      throw Error(
          fmt::format("session {}: the machine profile corrects {}. What is found here is against the files: name "
                      "a profile without correct_imager",
                      name, xray.label));
    session.views.push_back(
        {.label = xray.label,
         .model = ImagerModel(xray.view, rad_from_deg(*header.gantry_angle_deg), header.sid_mm.value()),
         .imager = imagers.number_of(xray.view.beam == Beam::kMegavoltage, radiation_machine(header)),
         .spots = dark_spots(xray, radius_mm * pixels_per_mm(xray.view)),
         .radius_px = radius_mm * pixels_per_mm(xray.view)});
  }
  return session;
}

// Moves are of one planned pose.
void require_one_plan(const std::vector<BallSession>& sessions) {
  constexpr double kAlike = 1e-9;
  const Eigen::Isometry3d& first = sessions.front().planned_room_from_patient;
  for (const BallSession& session : sessions)
    if (!session.planned_room_from_patient.isApprox(first, kAlike))
      throw Error(
          fmt::format("session {}: its plan puts the phantom elsewhere than that of session {}, as other couch "
                      "angles do; --moves needs one plan. Where the phantom lay against its plan: --positions",
                      session.name, sessions.front().name));
}

// Every session has a known pose, and every known pose a session.
void set_known_poses(const std::filesystem::path& csv, std::vector<BallSession>& sessions) {
  KnownPoses known = read_known_poses(csv);
  if (!known.have_angles)
    throw Error(
        fmt::format("{}: has no columns rx_deg, ry_deg, rz_deg. How the phantom is turned must be known: what it "
                    "is turned looks like an error of the imager",
                    csv.string()));
  for (BallSession& session : sessions) {
    const auto pose = known.by_session.find(session.name);
    if (pose == known.by_session.end())
      throw Error(fmt::format("{}: has no line for session {}", csv.string(), session.name));
    session.known_setup_error = pose->second;
    known.by_session.erase(pose);
  }
  if (!known.by_session.empty())
    throw Error(fmt::format("{}: names session {}, of which no folder was given", csv.string(),
                            known.by_session.begin()->first));
}

}  // namespace

BallGeometry ball_geometry(const BallGeometryRequest& request, Observer& observer) {
  BallGeometry geometry;
  ImagerNames imagers;
  std::vector<BallSession> sessions;
  std::vector<Ball> balls;
  CtStore cts;
  std::shared_ptr<const CtSeries> ct;
  for (const std::filesystem::path& folder : request.sessions) {
    StudyOptions options = request.study;
    options.parts.study = folder;
    const Study study = load(options, geometry.notes, observer, cts);
    if (!ct) {
      ct = study.ct;
      balls = balls_in(ct->hu);
    } else if (study.ct->series_instance_uid != ct->series_instance_uid) {
      throw Error(
          fmt::format("{}: another CT than that of the first session; name one for all: --ct FOLDER", folder.string()));
    }
    const std::string name = name_of_session(folder);
    if (std::ranges::find(geometry.sessions, name) != geometry.sessions.end())
      throw Error(fmt::format("two folders of sessions have the name {}: rename one", name));
    geometry.sessions.push_back(name);
    sessions.push_back(session_of(name, study, median_radius_mm(balls), imagers));
    geometry.views += sessions.back().views.size();
  }
  geometry.imagers = imagers.names();
  geometry.balls = balls.size();
  if (request.poses == BallPoses::kMoves) require_one_plan(sessions);
  if (request.poses != BallPoses::kFree) set_known_poses(request.known_poses, sessions);
  geometry.adjustment = adjusted(balls, sessions, request.poses, geometry.imagers.size());
  return geometry;
}

}  // namespace isoshift
