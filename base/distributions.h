#pragma once
// Quantiles and tails of distributions. Boost.Math behind one source, since it takes seconds to compile.

namespace isoshift {

// The value that a standard normal number, or Student's t, exceeds with this probability.
double normal_quantile(double upper_tail);
double students_t_quantile(double freedom, double upper_tail);

// The probability that Student's t exceeds a value.
double students_t_tail(double freedom, double t);

// The exact bounds (Clopper and Pearson 1934) of the probability behind `successes` of `trials`, each missed with the
// probability `tail`.
struct ShareBounds {
  double low = 0.0, high = 1.0;
};
ShareBounds clopper_pearson(double trials, double successes, double tail);

}  // namespace isoshift
