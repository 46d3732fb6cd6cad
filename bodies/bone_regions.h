#pragma once
// Which voxels are bone, and which of the vertebrae's.

#include <cstdint>
#include <vector>

#include "bodies/components.h"
#include "bodies/vertebrae.h"
#include "geometry/volume.h"

namespace isoshift {

// What a CT holds besides air: the patient and, if it lies apart, the couch.
struct PatientAndCouch {
  Volume<std::uint8_t> patient, couch;
};
PatientAndCouch patient_and_couch(const Volume<float>& hu);

// Removes contrast agent from a mask of bone: large parts without a rim that is brighter than they are inside, and
// what is no brighter than these. Vertebral bodies stay. Precondition: there is a vertebra.
void remove_contrast_agent(Volume<std::uint8_t>& bone, const Volume<float>& hu, const std::vector<Vertebra>& vertebrae);

// The bone of each vertebra, its arch included: each voxel belongs to the vertebral body that is nearest along bone.
std::vector<VoxelSet> bone_of(const std::vector<Vertebra>& vertebrae, const Volume<std::uint8_t>& bone);

}  // namespace isoshift
