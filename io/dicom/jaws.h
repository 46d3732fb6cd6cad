#pragma once
// What jaws and leaves leave open, by RT Images and RT Plans (PS3.3 C.8.8.2, C.8.8.14).

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "io/dicom/dicom_dataset.h"

namespace isoshift {

// How far two opposite jaws, or two opposite leaves, let the beam through: mm at the isocenter, along an axis of the
// collimator.
struct JawOpening {
  double from_mm = 0.0, to_mm = 0.0;
};

// A pair of leaves, and the strip that it covers across its motion.
struct LeafPair {
  JawOpening opening;
  double lower_mm = 0.0, upper_mm = 0.0;
};

// What a Beam Limiting Device Sequence leaves open. Nothing of devices of which it does not speak.
struct JawOpenings {
  std::optional<JawOpening> x, y;
  std::vector<LeafPair> leaves;  // from the lowest strip to the highest
  bool leaves_move_along_x = true;
  std::vector<std::string> problems;  // why devices are left out that the file describes: a line each

  bool is_empty() const { return !x && !y && leaves.empty(); }
};

// `positions`: items that say where the devices stand. `devices`: items that say what the devices are like, of a plan's
// beam; of an RT Image the same as `positions`.
JawOpenings read_jaws(const std::vector<DicomItem>& positions, const std::vector<DicomItem>& devices);

// The outline of what jaws and leaves together leave open: (x, y) along the collimator's axes, mm at the isocenter.
// Axes along which nothing is said are open beyond any receptor. Empty if nothing is open, or nothing is said.
std::vector<Eigen::Vector2d> outline_of(const JawOpenings& openings);

// "X -50 to 60 mm, Y -40 to 70 mm, 60 pairs of leaves along X, open by up to 110 mm"; "not declared".
std::string described(const JawOpenings& openings);

}  // namespace isoshift
