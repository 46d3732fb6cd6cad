#pragma once
// The front door of registration: X-ray views and a planned pose in, the actual pose and a verdict out.
//
//   const RegistrationResult result = register_views(*renderer, xrays, planned_room_from_patient, {});
//   if (result.verdict == Verdict::kAccepted) ...

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "drr/renderer.h"
#include "geometry/verdict.h"
#include "geometry/xray_image.h"
#include "registration/similarity/similarity.h"

namespace isoshift {

enum class Dof { kRigid, kTranslation };

// One stage of the search, coarse to fine. Parameters are the translation (mm) and the rotation vector (radians) of the
// setup error about the isocenter, in IEC 61217 fixed.
struct Stage {
  std::string name;
  SimilarityKind similarity = SimilarityKind::kNcc;
  double pixel_mm = 4.0;             // the stage's pixels, at the isocenter: the image is reduced to at least this size
  double pixel_fraction = 1.0;       // share of the field's pixels compared
  double initial_step_mm = 5.0;      // first trust-region radius of the translations
  double initial_step_rad = 0.05;    // the same for the rotations
  double relative_tolerance = 0.01;  // stop when steps fall below this share of the initial ones
  int max_evaluations = 200;         // one evaluation renders every view once
};

struct RegistrationOptions {
  Dof dof = Dof::kRigid;
  double bound_mm = 50.0;   // the search box about the planned pose
  double bound_rad = 0.35;  // the same for rotations, about 20 degrees
  double min_ncc = 0.8;     // a final mean NCC below this is at most `review`
  std::uint64_t seed = 1;   // the only source of randomness: same seed, same pose
  std::vector<Stage> stages = default_stages();

  static std::vector<Stage> default_stages();

  // Throws UsageError naming the field and its value.
  void check() const;
};

struct StageReport {
  std::string name;
  std::string similarity;
  int evaluations = 0;
  double seconds = 0.0;
  std::string termination = "not run";
  bool reached_limit = false;  // the evaluations ran out before the search converged
};

// Normalized cross correlation of one view over its whole field, at the resolution of the last stage.
struct ViewReport {
  double similarity_start = -1.0;
  double similarity_final = -1.0;
};

struct RegistrationResult {
  Verdict verdict = Verdict::kRejected;
  std::vector<std::string> reasons = {"not run"};  // why the verdict is not `accepted`
  std::vector<std::string> warnings;
  RendererKind renderer = RendererKind::kCpu;  // what rendered the DRRs
  Eigen::Isometry3d actual_room_from_patient = Eigen::Isometry3d::Identity();
  std::vector<Eigen::Vector3d> unobservable_room;  // unit directions along which the views cannot tell
  std::vector<ViewReport> views;
  std::vector<StageReport> stages;
  double seconds = 0.0, seconds_rendering = 0.0, seconds_similarity = 0.0;  // in all, and of that

  int evaluations() const;
};

// Progress of the search: the share done, from 0 to 1, an estimate.
using SearchProgress = std::function<void(double share)>;

RegistrationResult register_views(Renderer& renderer, std::span<const XrayImage> xrays,
                                  const Eigen::Isometry3d& planned_room_from_patient,
                                  const RegistrationOptions& options, const SearchProgress& progress = {});

}  // namespace isoshift
