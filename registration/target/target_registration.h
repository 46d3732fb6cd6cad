#pragma once
// Registration for a target: the patient as a whole, and where that needs a review, the bodies that carry the target.
// The front door for whoever answers for a setup or measures such answers.

#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "registration/bodies/register_bodies.h"
#include "registration/target/body_store.h"
#include "registration/target/chosen_region.h"
#include "registration/target/planned_patient.h"
#include "registration/target/surrogate.h"

namespace isoshift {

// How a CT is rendered.
struct Rendering {
  RendererKind kind = RendererKind::kCpu;
  AttenuationModel model;
  RendererOptions options;
  std::vector<Beam> beams = {Beam::kKilovoltage};
};

// What is registered, and where it must be right.
struct TargetProblem {
  PlannedPatient patient;
  Target target;
  Surrogate surrogate;
  std::function<std::vector<Target>()> others;  // volumes of which is told, too, where bodies answer; may be empty
  std::vector<ChosenVolume> chosen;             // what a person or a file chose of the CT,
  double margin_mm = 5.0;                       // and by how much that grows
  Rendering rendering;
  RegistrationOptions options;    // without a region: all that the CT shows is compared
  std::vector<Finding> findings;  // about the files, and about the choice of the target
};

// The share of a step that is done.
using StepProgress = std::function<void(std::string_view step, double share)>;

// Borrows renderers, the CT that they render, and the store. What only a bent patient needs is made when the first one
// comes.
class TargetRegistration {
 public:
  TargetRegistration(TargetProblem problem, const RendererPyramid& renderers, const Volume<float>& rendered_ct,
                     BodyStore& bodies);

  // Searches from this pose of the whole patient. `seed`: unset, that of the options. Several threads may call it at a
  // time.
  RegistrationResult from(const Eigen::Isometry3d& start_room_from_patient, std::span<const FixedImage> images,
                          const StepProgress& progress = {}, std::optional<std::uint64_t> seed = {}) const;

 private:
  // What is rendered and compared of the target's own surroundings.
  struct OwnBall {
    ChosenRegion region;
    std::optional<RendererPyramid> renderers;  // nothing: those of the whole CT
  };

  const BentPatient& bent_patient() const;
  const OwnBall& own_ball() const;
  void check_spots(std::span<const FixedImage> images, RegistrationResult& found) const;
  void check_against_region(std::span<const FixedImage> images, RegistrationResult& found) const;

  TargetProblem problem_;
  const RendererPyramid& renderers_;
  const Volume<float>& rendered_ct_;
  BodyStore& bodies_;
  mutable std::once_flag bent_once_;
  mutable std::optional<BentPatient> bent_;
  mutable std::once_flag ball_once_;
  mutable std::optional<OwnBall> ball_;
  std::vector<Finding> region_findings_;
};

}  // namespace isoshift
