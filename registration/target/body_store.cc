#include "registration/target/body_store.h"

namespace isoshift {

std::shared_ptr<const BodyMap> BodyStore::map(const std::shared_ptr<const Volume<float>>& ct_hu) {
  if (!map_ || ct_hu != ct_hu_) {
    map_.reset();  // never two in memory
    masks_.reset();
    map_ = std::make_shared<const BodyMap>(find_bodies(*ct_hu));
    ct_hu_ = ct_hu;
  }
  return map_;
}

std::shared_ptr<const SoftMasks> BodyStore::masks(const std::shared_ptr<const Volume<float>>& ct_hu) {
  const std::shared_ptr<const BodyMap> of_ct = map(ct_hu);
  if (!masks_) masks_ = std::make_shared<const SoftMasks>(soft_masks(*of_ct));
  return masks_;
}

}  // namespace isoshift
