#pragma once
// Which pixels of the views are compared: those whose rays meet the volume of interest and nothing that is excluded.

#include <memory>
#include <optional>
#include <vector>

#include "drr/renderer.h"
#include "registration/preprocess/preprocess.h"

namespace isoshift {

// Volumes hold 1 inside and 0 outside, in the CT's patient coordinates; their lattices may differ from the CT's.

// Where a CT ends although the body goes on: the columns of space beyond two opposite faces where the outermost voxels
// attenuate. The X-ray shows what lies there, the DRR does not.
struct CutEnds {
  Volume<std::uint8_t> columns;
  Eigen::Vector3d along_patient = Eigen::Vector3d::UnitZ();  // normal of the faces
};

struct RegionOfInterest {
  std::optional<Volume<std::uint8_t>> volume;  // unset: all
  std::vector<Volume<std::uint8_t>> excluded;  // such as a jaw that moves on its own
  std::vector<CutEnds> cut_ends;
};

// For each pair of faces that cuts the body, columns up to `reach_mm` long.
std::vector<CutEnds> beyond_the_ct(const Volume<float>& ct_hu, double threshold_hu, double reach_mm = 150.0);

// A CT without what lies outside a mask of the same size (1 inside): that becomes air.
Volume<float> only_inside(const Volume<float>& ct_hu, const Volume<std::uint8_t>& mask);
Volume<float> without(const Volume<float>& ct_hu, const Volume<std::uint8_t>& mask);

// The projections of a region of interest. May be used from several threads.
class ProjectedRegion {
 public:
  // Everything is compared.
  ProjectedRegion() = default;
  explicit ProjectedRegion(const RegionOfInterest& region);

  // Removes the pixels that are not compared from the field of an image. The patient's pose is known to within
  // `slack_mm`. If an excluded volume would remove more than nine tenths of the field, it removes nothing, and the
  // image says so (has_all_excluded). The space beyond the ends of the CT is removed in the same way, but the image
  // does not say if it stays. If the view looks toward these ends, the limit is a quarter instead of nine tenths: with
  // a body too thick for the CT, every ray passes through that space.
  void restrict(FixedImage& image, const Eigen::Isometry3d& room_from_patient, double slack_mm) const;

  // Whether a volume was chosen: X-rays then show what lies before and behind it, and DRRs do not.
  bool has_volume() const { return inside_ != nullptr; }

 private:
  std::unique_ptr<Renderer> inside_;
  std::vector<std::unique_ptr<Renderer>> outside_;
  struct Ends {
    std::unique_ptr<Renderer> renderer;
    Eigen::Vector3d along_patient;
  };
  std::vector<Ends> ends_;
};

}  // namespace isoshift
