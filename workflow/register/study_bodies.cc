#include "workflow/register/study_bodies.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/parallel.h"
#include "base/pattern.h"
#include "io/dicom/structure_mask.h"

namespace isoshift {

std::vector<DrawnBone> drawn_bones(const RtStructures& structures, const CtSeries& ct) {
  // Names of people, of TG-263 (VB_L3, Bone_Mandible, Rib07_L) and of TotalSegmentator (vertebrae_L3, clavicula_left,
  // rib_left_7). Lymph nodes, muscles, vessels and margins are named after bones, too: beside a bone's name there may
  // be its side and which part of it is drawn, and nothing else.
  static const Pattern bone(
      "(bone([ _-]?marrow)?[ _-])?("
      "[CTL]0?(\\d|1[0-2])|(vert(ebrae?)?|VB)[ _-]?[CTLS]?\\d+|skull|cranium|mandible|jaw|sacrum|sternum|"
      "rib[ _-]?(left|right|l|r)?[ _-]?\\d+([ _-](left|right|l|r))?|"
      "bone([ _-]?marrow)?[ _-]pelvic|pelvic[ _-](bones?|girdle)|"
      "(femur|femoral[ _]?head|humerus|scapula|clavicle|clavicula|pelvis|ilium|ischium|pubis|hip|tibia|fibula|"
      "patella|ulna|radius)([ _-](l|r|lt|rt|left|right|both|bones?|and|heads?|neck|shaft|prox(imal)?|dist(al)?))*)",
      Pattern::Case::kAny);
  std::vector<DrawnBone> result;
  for (const Structure& structure : structures.structures)
    if (!structure.contours.empty() && bone.matches(structure.name))
      result.push_back({structure.name, mask_of(structure, ct.hu.size, ct.hu.patient_from_voxel)});
  return result;
}

BodyMap bodies_of(const CtSeries& ct, const RtStructures* structures) {
  return find_bodies(ct.hu, structures == nullptr ? std::vector<DrawnBone>() : drawn_bones(*structures, ct));
}

std::string body_in_words(const BodyMap& map, int number) {
  const Body& body = map.bodies.at(static_cast<std::size_t>(number - 1));
  return fmt::format("body {}: {}", number, body.name.empty() ? to_string(body.kind) : body.name);
}

Volume<std::uint8_t> body_mask(const BodyMap& map, int number, const Volume<float>& lattice) {
  if (number < 1 || number > static_cast<int>(map.bodies.size()))
    throw UsageError(map.bodies.empty()
                         ? fmt::format("--body {}: the CT shows no bones", number)
                         : fmt::format("--body {}: the CT shows the bodies 1 to {} (isoshift inspect --bodies)", number,
                                       map.bodies.size()));
  if (map.bodies[static_cast<std::size_t>(number - 1)].kind == Body::Kind::kCouch)
    throw UsageError(fmt::format("--body {}: is the couch, not a bone of the patient", number));
  Volume<std::uint8_t> mask(lattice.size, lattice.patient_from_voxel);
  const Eigen::Affine3d label_from_voxel = map.labels.patient_from_voxel.inverse() * lattice.patient_from_voxel;
  parallel_for(0, lattice.size.z(), [&](int k) {
    for (int j = 0; j < lattice.size.y(); ++j)
      for (int i = 0; i < lattice.size.x(); ++i) {
        const Eigen::Array3i at = (label_from_voxel * Eigen::Vector3d(i, j, k)).array().round().cast<int>();
        const bool is_in_map = (at >= 0).all() && (at < map.labels.size.array()).all();
        if (is_in_map && map.labels.at(at.x(), at.y(), at.z()) == number) mask.at(i, j, k) = 1;
      }
  });
  return mask;
}

}  // namespace isoshift
