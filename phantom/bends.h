#pragma once
// How the body of a patient who lies in the room differs from the body in the planning CT: joints that are bent, soft
// tissue that was lost, a couch that only one of them shows.

#include <Eigen/Geometry>
#include <string>
#include <string_view>
#include <vector>

#include "phantom/anatomy.h"

namespace isoshift {

struct Bend {
  enum class Kind { kNeck, kSpine, kJaw, kShoulders, kWeightLoss, kMissingCouch, kExtraCouch };

  Kind kind = Kind::kNeck;
  double amount = 0.0;  // degrees (neck, spine, jaw) or mm (shoulders, weight-loss); of a couch 0

  // "neck", "spine:4", "weight-loss:10", ... Throws UsageError, with the kinds there are, for anything else.
  static Bend from_text(std::string_view text);
  std::string text() const;
};

// The rigid motion of a body against the CT, in patient coordinates.
struct BentBody {
  PhantomBody body;
  Eigen::Isometry3d moved_from_planned = Eigen::Isometry3d::Identity();
};

// One patient twice: as the CT shows the body and as the X-rays do.
struct BentPhantom {
  std::vector<Shape> in_ct, in_xrays;
  std::vector<BentBody> bodies;
};

// What bends need to know of an anatomy beside its parts.
struct BendingAnatomy {
  Eigen::Vector3d isocenter_patient_mm;     // bends of the spine grow from here
  Eigen::Vector3d spine_from_isocenter_mm;  // a point of the spine's line at the isocenter's height
  double couch_top_from_isocenter_mm = 0;   // how far behind the isocenter (patient y) the couch begins
  double couch_width_mm = 0;
};

// Throws UsageError if the anatomy ("head", "spine" or "thorax") cannot be bent so.
void check_bends(const std::vector<Bend>& bends, std::string_view anatomy, std::string_view patient_position);

// Gives every vertebra a size and processes of its own, so that one level off can be told. The unbent phantoms keep
// equal processes.
void make_vertebrae_differ(PhantomParts& parts, std::uint64_t seed);

// Each rigid body moves as one piece, by the motion of the point where it hangs on the rest; soft tissue by the motion
// of the center of each shape. What lies at the isocenter does not move.
BentPhantom bent(PhantomParts parts, const std::vector<Bend>& bends, const BendingAnatomy& anatomy);

}  // namespace isoshift
