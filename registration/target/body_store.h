#pragma once
// The rigid bodies of a CT, found once for all registrations that share it.

#include <memory>

#include "bodies/body_map.h"
#include "bodies/soft_masks.h"

namespace isoshift {

// Keeps the bodies of the last CT.
class BodyStore {
 public:
  std::shared_ptr<const BodyMap> map(const std::shared_ptr<const Volume<float>>& ct_hu);

  // What moves with these bodies.
  std::shared_ptr<const SoftMasks> masks(const std::shared_ptr<const Volume<float>>& ct_hu);

 private:
  std::shared_ptr<const Volume<float>> ct_hu_;
  std::shared_ptr<const BodyMap> map_;
  std::shared_ptr<const SoftMasks> masks_;
};

}  // namespace isoshift
