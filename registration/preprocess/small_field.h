#pragma once
// Small fields of the treatment beam, as cones and stereotactic leaves make.

#include <array>
#include <optional>

#include "registration/preprocess/field_edges.h"

namespace isoshift {

// Where half the beam arrives, in pixels of the upright image.
struct SmallField {
  std::array<double, 4> sides{};  // left, right, top, bottom: of a circle where it touches them
  bool is_round = false;
  double sigma_mm = 0.0;  // of the least certain side
};

// The only bright place of an image of the treatment beam, if it is no wider than 45 mm and a rectangle or a circle.
//
// Its edges by themselves would mislead: beyond leaves and cones the light falls without end, by a factor of four or
// more per penumbra, down to the jaws, whose edges are as steep in the logarithm and longer. But half the brightness of
// such a field is half the beam: so little lies in it. And its surroundings are dark, which nothing but a collimator
// makes them: more than a tenth of the treatment beam passes through a patient.
std::optional<SmallField> find_small_field(const UprightXray& xray);

}  // namespace isoshift
