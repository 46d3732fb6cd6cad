#pragma once
// The numbers of a result that people and scripts may see: every format takes them from here.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "setup/action.h"
#include "setup/setup_errors.h"
#include "setup/setup_result.h"

namespace isoshift {

// What may be shown of the result. Components along an unobservable direction are absent. If the shift is withheld (the
// result is rejected), all components of the couch shift are absent.
struct ShownShift {
  std::array<std::optional<double>, 3> setup_error_mm;  // x, y, z, IEC 61217 fixed
  std::array<double, 3> setup_error_deg;                // rx, ry, rz of R = Rz Rx Ry
  std::array<std::optional<double>, 3> sigma_mm;        // x, y, z; absent where the component is
  std::array<std::optional<double>, 3> sigma_deg;       // about x, y, z
  std::array<std::optional<double>, 3> target_mm;  // how far the target's center lies from its plan, as setup_error_mm
  std::array<std::optional<double>, 3> target_sigma_mm;  // absent where the component is
  bool withheld = false;                                 // the verdict forbids a couch shift
  std::array<std::optional<double>, 3> couch_mm;         // lateral, longitudinal, vertical
  std::array<std::optional<double>, 3> couch_sigma_mm;
  std::array<double, 3> couch_deg;         // yaw, pitch, roll: change of the read-outs
  std::array<double, 3> couch_target_deg;  // yaw, pitch, roll: resulting read-outs
  std::array<bool, 3> can_rotate;          // yaw, pitch, roll: whether the site's couch can
  // Lateral, longitudinal, vertical of what the site's couch can do: where it cannot make all rotations, the
  // translation that brings the target's center (the isocenter, if no target is known) to where it was planned.
  std::array<std::optional<double>, 3> applied_mm;
  // The error that remains after the couch has applied what it can of the shift: at the isocenter, 50 mm superior and
  // inferior of it, and at the points of the result. Empty if a component is not determined.
  struct LeftOver {
    std::string at;
    Eigen::Vector3d mm = Eigen::Vector3d::Zero();  // IEC 61217 fixed
  };
  std::vector<LeftOver> left_over;
  // What a bone did against the target. Motions are those of a patient seen along his axes: left, back, head.
  struct Moved {
    std::string name;
    std::optional<int> vertebra;  // as BodyMotion has it
    double from_target_mm = 0.0;  // of its center, as planned
    double carries_target = 0.0;
    bool breathes = false;
    bool is_determined = false;  // without it, there are no numbers
    std::optional<double> mm, two_sigma_mm, deg;
    // Unit vectors; nothing: it did not move, or the patient's position is not known.
    std::optional<Eigen::Vector3d> direction_patient, axis_patient;
  };
  std::vector<Moved> moved;  // the nearest to the target first; empty: the patient as a whole was registered
  ActionDecision decision;   // by the site's action level
};
ShownShift shown_shift(const SetupResult& result);

// The shown setup error as the components of kErrorComponents.
std::array<std::optional<double>, 6> shown_components(const ShownShift& shown);
// Nothing if one of them is absent.
std::optional<ErrorComponents> complete_components(const ShownShift& shown);

}  // namespace isoshift
