#pragma once
// Registers a study for its target: the patient as a whole, and where that needs a review, the bodies that carry the
// target. For every command that answers for a setup or measures such answers.

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "registration/bodies/register_bodies.h"
#include "workflow/observer.h"
#include "workflow/register/body_store.h"
#include "workflow/register/registration_setup.h"
#include "workflow/register/surrogate.h"
#include "workflow/register/target_of.h"

namespace isoshift {

// Borrows all. What only a bent patient needs is made when the first one comes.
class TargetRegistration {
 public:
  TargetRegistration(const Study& study, const RegistrationRequest& request, const RegistrationSetup& setup,
                     const TargetChoice& choice, const Surrogate& surrogate, BodyStore& bodies);

  // Searches from this pose of the whole patient; doubts about study, target and surrogate make the result a review.
  // `seed`: unset, the request's. Several threads may call it at a time.
  RegistrationResult from(const Eigen::Isometry3d& start_room_from_patient, std::span<const FixedImage> images,
                          Observer& observer, std::optional<std::uint64_t> seed = {}) const;

 private:
  // What is rendered and compared of the target's own surroundings.
  struct OwnBall {
    RegionOfStudy region;
    std::optional<RendererPyramid> renderers;  // nothing: those of the whole CT
  };

  const BentPatient& bent_patient() const;
  const OwnBall& own_ball() const;
  void doubt_contradicted_region(std::span<const FixedImage> images, RegistrationResult& found) const;

  const Study& study_;
  const RegistrationRequest& request_;
  const RegistrationSetup& setup_;
  const TargetChoice& choice_;
  const Surrogate& surrogate_;
  BodyStore& bodies_;
  RegistrationOptions options_;
  mutable std::once_flag bent_once_;
  mutable std::optional<BentPatient> bent_;
  mutable std::once_flag ball_once_;
  mutable std::optional<OwnBall> ball_;
  std::vector<std::string> region_doubts_;
};

}  // namespace isoshift
