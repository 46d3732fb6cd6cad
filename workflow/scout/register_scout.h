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
#include "setup/view_picture.h"
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
  bool is_seen = false;  // known to within 1 mm or degree at two sigma, and not along the rays
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
  // How many times as wide, across the table, the scout shows the CT as spacing and distances say. It is what the match
  // tells about the translation along the rays.
  double width = 1.0, width_sigma = 0.0;
  int starts = 0;  // for repeatability: displaced by up to kStartMm
  static constexpr double kStartMm = 10.0;
  std::string renderer, device;
  Identity patient;
  std::string ct_series_instance_uid, frame_of_reference_uid;
  std::string scout_sop_instance_uid, scout_sha256, scout_patient_position;  // the last may be empty
  Notes notes;
  ViewPicture picture;  // the part of the scout that the CT covers, with the CT as rendered from the tube's side
  double picture_aspect = 1.0;  // how many times as high as wide its pixels are, in mm of the plane
};

// Throws Error where the two are of different patients or frames of reference, and for what read_ct_series() and
// read_scout() refuse.
ScoutRegistration register_scout(const ScoutRequest& request, Observer& observer);

}  // namespace isoshift
