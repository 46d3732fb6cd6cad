#pragma once
// The front door of registration: X-ray views and a planned pose in, the actual pose and a verdict out.
//
//   const RegistrationResult result =
//       register_views(renderers, prepared(xrays), planned_room_from_patient, preset("setup"));
//   if (result.verdict() == Verdict::kAccepted) ...

#include <Eigen/Geometry>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drr/renderer_pyramid.h"
#include "registration/quality/alternatives.h"
#include "registration/quality/consistency.h"
#include "registration/quality/contradiction.h"
#include "registration/quality/cross_checks.h"
#include "registration/quality/uncertainty.h"
#include "registration/search.h"
#include "setup/registration.h"

namespace isoshift {

struct RegistrationOptions : SearchOptions {
  std::string preset;            // what the stages are called
  bool is_searched = true;       // false: the start itself is judged, and needs a review
  bool eight_bit_xrays = false;  // line integrals of the field in 256 steps, as the founding paper's
  bool check_alternatives = true;
  bool check_vertebrae = false;  // along the spine; on request, for it takes as long as the registration
  RectanglesByLabel rectangles;  // of the views with these labels: nothing else of them is compared
  std::shared_ptr<const ProjectedRegion> region;  // what of the views is compared; null: all
  // How far errors of the imagers may have put the pose off: as Uncertainty, and added to what the images say.
  std::optional<Uncertainty> by_imagers;
  std::optional<Eigen::Vector3d> target_patient_mm;  // where its place must be certain; nothing: at the isocenter

  // Throws UsageError naming the field and its value.
  void check() const;
};

struct RegistrationResult : Registration {
  std::vector<ViewMatch> views;
  TurnBetweenViews turn;
  std::vector<Eigen::Isometry3d> wanted_by_views;  // the pose of the whole that each view alone wants
  std::optional<ViewsApart> apart;                 // where bodies were searched
};

// What of the X-rays is compared, by the options' rectangles and region.
FixedViews compared_views(const RegistrationOptions& options, std::span<const FixedImage> images);

// Searches from `start_room_from_patient`, the planned pose, and judges what it finds. `images`: the X-ray of each
// view, as prepared() returns it. Throws Error where the CT does not appear in a view.
RegistrationResult register_views(const RendererPyramid& renderers, std::span<const FixedImage> images,
                                  const Eigen::Isometry3d& start_room_from_patient, const RegistrationOptions& options,
                                  const SearchProgress& progress = {});

}  // namespace isoshift
