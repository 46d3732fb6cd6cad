#pragma once
// A CT registered to its own scout, a real X-ray at a known pose: the answer should be nothing, and what is found says
// how well scanner, CT and registration agree (docs/commands/scout.md).

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/dicom/scout.h"
#include "setup/verdict.h"
#include "workflow/observer.h"
#include "workflow/register/rendering_options.h"

namespace isoshift {

struct ScoutRequest {
  std::filesystem::path ct, scout;
  std::optional<TubeSide> tube;  // unset: the side that matches better
  ScoutSwitches distances;
  Allowances allowed;
  RenderingOptions rendering;
  std::uint64_t seed = 1;
};

// Along and about the patient's axes, LPS: left, posterior, superior; translations in mm, then rotations in rad.
struct ScoutAxis {
  bool is_seen = false;  // across the rays, or known to within 1 mm or degree at two sigma
  double offset = 0.0, sigma = 0.0;
  double repeatability = 0.0;  // the largest distance of the other starts' ends
};

struct ScoutRegistration {
  Verdict verdict = Verdict::kRejected;
  std::vector<std::string> reasons;
  TubeSide tube = TubeSide::kLeft;
  double match = 0.0, match_from_other_side = 0.0;  // gradient correlation
  // Where the CT's anatomy lies in the scout, against where the CT says, at the center of the CT.
  std::array<ScoutAxis, 6> axes;
  Eigen::Vector3d center_patient_mm = Eigen::Vector3d::Zero();
  int starts = 0;  // for repeatability: displaced by up to kStartMm
  static constexpr double kStartMm = 10.0;
  std::string renderer, device, scout_sha256, ct_series_instance_uid;
  Notes notes;
};

// Throws Error where the two are of different patients or frames of reference, and for what read_ct_series() and
// read_scout() refuse.
ScoutRegistration register_scout(const ScoutRequest& request, Observer& observer);

}  // namespace isoshift
