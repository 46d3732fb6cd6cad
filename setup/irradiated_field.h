#pragma once
// Where an X-ray's receptor was irradiated, and how sure that is.

#include <Eigen/Core>
#include <array>
#include <string>
#include <vector>

namespace isoshift {

struct IrradiatedField {
  enum class Origin {
    kWholeReceptor,  // no edge was found
    kFound,          // in the image
    kDeclared,       // by the file, and seen in the image
    kDrawn,          // by a person
  };

  Origin origin = Origin::kWholeReceptor;
  std::vector<Eigen::Vector2d> corners_px;  // of the field, in the X-ray as acquired: where half the beam arrives
  double sigma_mm = 0.0;                    // of its least certain side, at the isocenter
  double keep_off_mm = 0.0;  // its sides may lie this much farther in: what is compared keeps off them by as much more
  std::string doubt;         // why it is not sure; empty: it is

  bool is_sure() const { return doubt.empty(); }
};

inline constexpr std::array kFieldOrigins = {IrradiatedField::Origin::kWholeReceptor, IrradiatedField::Origin::kFound,
                                             IrradiatedField::Origin::kDeclared, IrradiatedField::Origin::kDrawn};
// "whole receptor", "found", "declared", "drawn".
const char* to_string(IrradiatedField::Origin origin);

// How far within a field's sides a place of the X-ray lies; negative outside. Precondition: the field has corners.
double inside_px(const IrradiatedField& field, const Eigen::Vector2d& place_px);

}  // namespace isoshift
