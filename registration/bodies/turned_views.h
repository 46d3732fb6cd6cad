#pragma once
// Whether bodies moved, or the geometry of one view is another than its file says.

#include <memory>
#include <span>

#include "registration/bodies/body_search.h"
#include "registration/quality/contradiction.h"

namespace isoshift {

// A gantry or receptor angle, a distance or a panel's place that is wrong in one view, or a patient who moved between
// the views, looks like bones that moved. So the rigid patient is given a pose of its own in every view: the most
// probable one in that view alone. What these poses gain in probability over the whole patient's pose (in nats) is
// compared with what bodies gain that were found at `found`, less what their springs cost.
class TurnedViews {
 public:
  TurnedViews(const BodyScene& scene, const BodyPoses& found);
  ~TurnedViews();

  // Without translations along the turn's axis, along which anatomy breathes. The share of what bodies gain; where they
  // gain nothing, 1.
  double share_explained_by(const TurnBetweenViews& turn);

  // With all six degrees of freedom. `wanted`: the pose that every view alone wants (Contradictions). Where the poses
  // cannot come near what bodies gain, the gain is an estimate.
  ViewsApart apart(std::span<const Eigen::Isometry3d> wanted);

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace isoshift
