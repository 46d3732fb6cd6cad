#pragma once
// The bodies that a search for a bent patient moves, made from those that the CT shows: few enough to be found, small
// enough to be rigid.

#include "bodies/body_map.h"
#include "bodies/soft_masks.h"
#include "registration/bodies/jointed_bodies.h"

namespace isoshift {

struct PatientBodies {
  JointedBodies bodies;
  // How much bones carry each place, as BodyShare: they add up to 255, soft tissue far from bone included. None for
  // bodies of soft tissue. And how far a place is from bone.
  std::vector<BodyShare> carried;
  Volume<float> to_bone_mm;
  // The shares of all bodies in carrying the target, which add up to 1, where a person names what carries it. Empty:
  // the bones near it do.
  std::vector<double> named_carriers;
};

// Every vertebra is a body, with its spinous process where that is a bone by itself. Other bones are taken together: in
// a CT with vertebrae by side of the spine (left, right, front) and in slabs of 60 mm along it, counted from the
// target, since single ribs lose their way; without vertebrae they stay as they are. Groups in front that hold ribs
// breathe. Soft tissue farther than 15 to 30 mm from bone (heart, diaphragm, bowel, brain) is divided in slabs of 80
// mm, left and right, and breathes. The shares of all bodies add up to 255 as `masks` do. Empty if the CT shows no
// body.
PatientBodies patient_bodies(const BodyMap& map, SoftMasks masks, const Eigen::Vector3d& target_patient_mm);

// How the bone within a structure (1 inside) is divided among the bodies: parts of 1. Empty if there is none.
std::vector<double> shares_of_bone_in(const PatientBodies& patient, const Volume<std::uint8_t>& structure);

// The values of shares at a place, as parts of 1.
std::vector<double> shares_at(std::span<const BodyShare> shares, const Eigen::Vector3d& place_patient_mm);

}  // namespace isoshift
