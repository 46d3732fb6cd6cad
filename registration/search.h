#pragma once
// The search for the pose at which DRRs match the X-rays, in stages from coarse to fine.

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drr/renderer_pyramid.h"
#include "registration/optimizer.h"
#include "registration/preprocess/preprocess.h"
#include "registration/region.h"
#include "registration/similarity/similarity.h"
#include "setup/registration.h"

namespace isoshift {

enum class Dof { kRigid, kTranslation };

// One stage. It searches from `starts` poses at the same time: from the poses that the stage before kept, and from the
// best of `candidates` poses that are drawn around the first of them, within `reach`. It keeps the best `keep` poses at
// which these searches end.
struct Stage {
  std::string name;
  SimilarityKind similarity = SimilarityKind::kNcc;
  OptimizerKind optimizer = OptimizerKind::kBobyqa;
  double pixel_mm = 4.0;        // the stage's pixels, at the isocenter: the image is reduced to at most this size
  double voxel_mm = 0.0;        // the CT is reduced to voxels up to this edge; 0: not at all
  double pixel_fraction = 1.0;  // share of the field's pixels compared
  int min_pixels = 1000;        // of every view, if the field has them
  int candidates = 0;
  int starts = 1;
  int keep = 1;
  double reach_mm = 0.0;             // candidates are drawn in a box of this half width
  double reach_rad = 0.0;            // the same for the rotations
  double initial_step_mm = 5.0;      // first trust-region radius of the translations
  double initial_step_rad = 0.05;    // the same for the rotations
  double relative_tolerance = 0.01;  // stop when steps fall below this share of the initial ones
  int max_evaluations = 200;         // per start; one evaluation renders every view once
};

struct SearchOptions {
  std::vector<Stage> stages;
  Dof dof = Dof::kRigid;
  double bound_mm = 50.0;          // the search box about the start
  double bound_rad = 0.35;         // the same for rotations, about 20 degrees
  std::uint64_t seed = 1;          // the only source of randomness: same seed, same pose
  std::vector<double> parameters;  // where to begin; empty: at no setup error
};

// Progress of a search: the share done, from 0 to 1, an estimate.
using SearchProgress = std::function<void(double share)>;

struct SearchResult {
  std::vector<double> parameters;  // PoseParameters: of the setup error on top of the start
  std::vector<StageReport> stages;
  double seconds_rendering = 0.0, seconds_similarity = 0.0;
};

// The X-rays and what of them is compared.
struct FixedViews {
  std::vector<FixedImage> images;
  const ProjectedRegion& region;

  // The images as a stage compares them: reduced to pixels of at most `pixel_mm` (smaller ones if the field is small),
  // and restricted to the region, with the patient at a pose that is known to within `slack_mm`.
  std::vector<FixedImage> reduced_to(double pixel_mm, const Eigen::Isometry3d& room_from_patient,
                                     double slack_mm) const;
};

SearchResult search(const RendererPyramid& renderers, const FixedViews& views,
                    const Eigen::Isometry3d& start_room_from_patient, const SearchOptions& options,
                    const SearchProgress& progress = {});

// The same for a start or images that may make no sense; nothing if too few pixels are left to compare.
std::optional<SearchResult> search_if_possible(const RendererPyramid& renderers, const FixedViews& views,
                                               const Eigen::Isometry3d& start_room_from_patient,
                                               const SearchOptions& options);

}  // namespace isoshift
