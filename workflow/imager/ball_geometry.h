#pragma once
// The geometry of imagers from X-rays of a phantom with metal balls (docs/commands/geometry.md).

#include <filesystem>
#include <string>
#include <vector>

#include "registration/imager/bundle_adjustment.h"
#include "workflow/observer.h"
#include "workflow/register/study_options.h"

namespace isoshift {

struct BallGeometryRequest {
  std::vector<std::filesystem::path> sessions;  // folders of X-rays, of one phantom
  StudyOptions study;                           // its other parts, and what the files lack; without `parts.study`
  BallPoses poses = BallPoses::kFree;
  std::filesystem::path known_poses;  // CSV (workflow/commission/known_poses.h); of free poses: empty
};

struct BallGeometry {
  std::vector<std::string> imagers;  // ImagerNames::names(), as the adjustment has them
  std::vector<std::string> sessions;
  std::size_t balls = 0, views = 0;
  BundleAdjustment adjustment;
  Notes notes;
};

// Throws Error for what load_study(), balls_in() and adjusted() refuse, for X-rays without a gantry angle, and naming a
// session that has no known pose, or a known pose that has no session.
BallGeometry ball_geometry(const BallGeometryRequest& request, Observer& observer);

}  // namespace isoshift
