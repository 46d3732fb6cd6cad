#pragma once
// What jaws and leaves leave open, by RT Images and RT Plans (PS3.3 C.8.8.2, C.8.8.14).

#include <optional>

#include "io/dicom/dicom_dataset.h"

namespace isoshift {

// How far two opposite jaws, or the leaves that are open farthest, let the beam through: mm at the isocenter, along the
// collimator's axes.
struct JawOpening {
  double from_mm = 0.0, to_mm = 0.0;
};

// What the items of a Beam Limiting Device (Position) Sequence leave open, jaws and leaves together. Nothing along an
// axis of which they do not speak.
struct JawOpenings {
  std::optional<JawOpening> x, y;
};
// Adds what an item of the sequence says; leaves whose boundaries it does not know open as far as any of them.
void add_jaws(const DicomItem& device, JawOpenings& openings);

}  // namespace isoshift
