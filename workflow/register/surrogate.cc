#include "workflow/register/surrogate.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "bodies/body_map.h"
#include "io/dicom/structure_mask.h"
#include "registration/bodies/carriers.h"

namespace isoshift {
namespace {

constexpr double kLeastMm3 = 100.0;

// Whether a CT shows bone near a place: as much as a small piece of rib, or a ball. Quicker than finding its bodies,
// which only bent patients need.
bool is_bone_near(const Volume<float>& ct_hu, const Eigen::Vector3d& patient_mm) {
  const double bone_hu = BodyOptions().bone_hu;
  const Eigen::Vector3d center = ct_hu.patient_from_voxel.inverse() * patient_mm;
  const Eigen::Vector3d spacing = ct_hu.spacing_mm(), reach = kCarriersNearMm * spacing.cwiseInverse();
  const Eigen::Vector3i first = (center - reach).array().ceil().max(0.0).cast<int>();
  const Eigen::Vector3i last =
      (center + reach).array().floor().min(ct_hu.size.array().cast<double>() - 1.0).cast<int>();
  double found_mm3 = 0.0;
  for (int k = first.z(); k <= last.z(); ++k)
    for (int j = first.y(); j <= last.y(); ++j)
      for (int i = first.x(); i <= last.x(); ++i)
        if (ct_hu.at(i, j, k) >= bone_hu &&
            (Eigen::Vector3d(i, j, k) - center).cwiseProduct(spacing).norm() <= kCarriersNearMm)
          found_mm3 += spacing.prod();
  return found_mm3 >= kLeastMm3;
}

bool holds_bone(const Volume<float>& ct_hu, const Volume<std::uint8_t>& structure) {
  double found_mm3 = 0.0;
  for (std::size_t n = 0; n < ct_hu.voxels.size(); ++n)
    if (structure.voxels[n] != 0 && ct_hu.voxels[n] >= BodyOptions().bone_hu) found_mm3 += ct_hu.spacing_mm().prod();
  return found_mm3 >= kLeastMm3;
}

}  // namespace

Surrogate surrogate_of(const Study& study, const Target& target, const std::string& by_site) {
  if (!by_site.empty()) {
    if (!study.structures)
      throw Error(
          fmt::format("surrogate {} (the site file): the study holds no RT Structure Set (--structures FILE "
                      "names one)",
                      by_site));
    Volume<std::uint8_t> drawn =
        mask_of(structure_named(*study.structures, by_site), study.ct->hu.size, study.ct->hu.patient_from_voxel);
    if (!holds_bone(study.ct->hu, drawn))
      throw Error(fmt::format("surrogate {} (the site file): the CT shows no bone in this structure", by_site));
    return {.words = fmt::format("bones in {} (the site file)", by_site), .drawn = std::move(drawn), .doubt = {}};
  }
  const auto is_near = [&](const Eigen::Vector3d& room_mm) {
    return is_bone_near(study.ct->hu, study.planned_room_from_patient.inverse() * room_mm);
  };
  if (is_near(target.center_room_mm) || std::ranges::any_of(target.extent_room_mm, is_near))
    return {.words = fmt::format("bone within {:.0f} mm", kCarriersNearMm), .drawn = {}, .doubt = {}};
  return {
      .words = "none",
      .drawn = {},
      .doubt = fmt::format("no bone lies within {:.0f} mm of the target, and the site file names no surrogate: X-rays "
                           "do not show soft tissue",
                           kCarriersNearMm)};
}

}  // namespace isoshift
