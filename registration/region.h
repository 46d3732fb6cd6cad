#pragma once
// What of the views is compared: pixels whose rays meet a volume of interest, and none that meet what is left out.

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

// Its projections. May be used from several threads.
class ProjectedRegion {
 public:
  // Everything is compared.
  ProjectedRegion() = default;
  explicit ProjectedRegion(const RegionOfInterest& region);

  // Takes out of the field of an image what is not compared with the patient at a pose known to within `slack_mm`.
  // None of what is left out takes more than nine tenths of the field: that stays, and the image says so. Ends of the
  // CT stay without a word, and where the view looks along them also if they would take more than a quarter: all of a
  // body too thick for the CT lies between them.
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
