#pragma once
// How the target of a breathing phantom moves.

#include <cstdint>
#include <vector>

#include "geometry/motion_sample.h"

namespace isoshift {

struct BreathingOptions {
  double seconds = 0.0;             // of X-rays; 0: the phantom holds its breath
  double rate_hz = 5.0;             // of each imager
  int phases = 10;                  // of the 4D CT; 0: none
  std::vector<MotionSample> trace;  // displacements in patient axes against time; empty: a breath of our own
};

// Displacement of the target in patient axes (LPS), 0 at the end of expiration. Of its own the phantom moves by about
// 12 mm toward the feet and 3 mm to the front, every breath of another depth and length; a trace moves it from its
// first position on, and is begun again at its end.
class Breathing {
 public:
  Breathing(BreathingOptions options, std::uint64_t seed);

  Eigen::Vector3d displacement_mm(double time_s) const;
  // Of the mean breath, at a phase from 0 to 1.
  static Eigen::Vector3d phase_displacement_mm(double phase);

 private:
  struct Breath {
    double begin_s, length_s, depth;
  };
  BreathingOptions options_;
  std::vector<Breath> breaths_;
};

}  // namespace isoshift
