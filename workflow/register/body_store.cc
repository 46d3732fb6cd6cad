#include "workflow/register/body_store.h"

namespace isoshift {

std::shared_ptr<const BodyMap> BodyStore::map(const std::shared_ptr<const CtSeries>& ct) {
  if (!map_ || ct != ct_) {
    map_.reset();  // never two in memory
    masks_.reset();
    map_ = std::make_shared<const BodyMap>(find_bodies(ct->hu));
    ct_ = ct;
  }
  return map_;
}

std::shared_ptr<const SoftMasks> BodyStore::masks(const std::shared_ptr<const CtSeries>& ct) {
  const std::shared_ptr<const BodyMap> of_ct = map(ct);
  if (!masks_) masks_ = std::make_shared<const SoftMasks>(soft_masks(*of_ct));
  return masks_;
}

}  // namespace isoshift
