#pragma once
// What was found of an imager's errors.

#include <array>

#include "geometry/imager_error.h"

namespace isoshift {

struct ImagerEstimate {
  struct Parameter {
    double value = 0.0, sigma = 0.0;  // mm or rad
    bool is_determined = false;
  };
  std::array<Parameter, kImagerParameters> parameters;

  // Undetermined are those whose sigma exceeds largest_sigma of imager_parameters().
  void set(std::size_t parameter, double value, double sigma) {
    parameters[parameter] = {
        .value = value, .sigma = sigma, .is_determined = sigma <= imager_parameters()[parameter].largest_sigma};
  }
};

}  // namespace isoshift
