#pragma once
// The front door of registration: X-ray views and a planned pose in, the actual pose and a verdict out.
//
//   const RegistrationResult result =
//       register_views(renderers, xrays, planned_room_from_patient, preset("setup"));
//   if (result.verdict == Verdict::kAccepted) ...

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drr/renderer_pyramid.h"
#include "geometry/xray_image.h"
#include "registration/quality/alternatives.h"
#include "registration/quality/consistency.h"
#include "registration/quality/cross_checks.h"
#include "registration/quality/uncertainty.h"
#include "registration/search.h"
#include "setup/verdict.h"

namespace isoshift {

struct RegistrationOptions {
  std::string preset;  // what the stages are called
  std::vector<Stage> stages;
  Dof dof = Dof::kRigid;
  double bound_mm = 50.0;        // the search box about the start
  double bound_rad = 0.35;       // the same for rotations, about 20 degrees
  std::uint64_t seed = 1;        // the only source of randomness: same seed, same pose
  bool eight_bit_xrays = false;  // line integrals of the field in 256 steps, as the founding paper's
  bool check_alternatives = true;
  bool check_vertebrae = false;  // along the spine; on request, for it takes as long as the registration
  std::map<std::string, PixelRectangle> rectangles;  // of the views with these labels: nothing else of them is compared
  const ProjectedRegion* region = nullptr;           // borrowed; what of the views is compared. nullptr: all

  // Throws UsageError naming the field and its value.
  void check() const;
};

// Gradient correlation of one view over all that is compared, in pixels twice as large as those of the last stage.
struct ViewReport {
  std::string label;  // of the X-ray
  double similarity_start = -1.0;
  double similarity_final = -1.0;
  bool has_all_left_out = true;         // what was excluded, with the patient at the pose found
  ViewConsistency consistency;          // of its parts with the pose found
  std::optional<LeftOutView> left_out;  // with three or more views
};

struct RegistrationResult {
  Verdict verdict = Verdict::kRejected;
  std::vector<std::string> reasons = {"not run"};  // why the verdict is not `accepted`
  RendererKind renderer = RendererKind::kCpu;      // what rendered the DRRs
  Eigen::Isometry3d actual_room_from_patient = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Vector3d> unobservable_room;  // unit directions along which the views cannot tell
  std::optional<Uncertainty> uncertainty;          // nothing: the images do not determine the pose
  std::vector<ViewReport> views;
  std::vector<StageReport> stages;
  std::vector<Alternative> alternatives;                                    // empty: the preset leaves them out
  double seconds = 0.0, seconds_rendering = 0.0, seconds_similarity = 0.0;  // in all, and of that in the search

  // Makes the verdict `to`, if that is worse than what it was, and adds the reason.
  void demote(Verdict to, std::string reason);
  int evaluations() const;
};

// Searches from `start_room_from_patient`, the planned pose, and judges what it finds. Throws Error for a blank X-ray,
// and where the CT does not appear in a view.
RegistrationResult register_views(const RendererPyramid& renderers, std::span<const XrayImage> xrays,
                                  const Eigen::Isometry3d& start_room_from_patient, const RegistrationOptions& options,
                                  const SearchProgress& progress = {});

}  // namespace isoshift
