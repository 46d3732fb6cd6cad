#pragma once
// The vertebrae along a spine's center line, told apart by the discs between them.

#include <Eigen/Core>
#include <vector>

#include "geometry/volume.h"

namespace isoshift {

// A plane between two vertebrae, or where the last one that the CT shows ends.
struct DiscPlane {
  Eigen::Vector3d center_patient_mm = Eigen::Vector3d::Zero();
  Eigen::Vector3d up_patient = Eigen::Vector3d::UnitZ();  // its normal, toward the head
};

struct Vertebra {
  Eigen::Vector3d center_patient_mm = Eigen::Vector3d::Zero();  // of the vertebral body, without its arch
  DiscPlane lower, upper;
  double radius_mm = 0.0;  // of the vertebral body, about
  bool has_edges = false;  // its body ends on all four sides, as one does; else its place is that of its neighbors
  bool is_cut = false;     // by the end of the CT or of the visible spine: its center is told from its neighbors
};

// The vertebra at the level of a point. Precondition: there is one.
const Vertebra& level_of(const Eigen::Vector3d& at_patient_mm, const std::vector<Vertebra>& vertebrae);

// From the feet to the head; empty if the CT shows fewer than two. `hu_on_patient_axes` is the CT on a lattice of about
// 2 mm (on_patient_axes()).
std::vector<Vertebra> find_vertebrae(const Volume<float>& ct_hu, const Volume<float>& hu_on_patient_axes);

// Whether a CT ends so soon above the uppermost vertebra that it shows no head there. Precondition: there is one.
bool ends_below_head(const std::vector<Vertebra>& vertebrae, const Volume<float>& hu_on_patient_axes);

// Whether a CT shows a trunk, with ribs, vessels and arms: four vertebrae or more, or fewer without a head above.
bool is_trunk(const std::vector<Vertebra>& vertebrae, const Volume<float>& hu_on_patient_axes);

}  // namespace isoshift
