#include "base/distributions.h"

#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/normal.hpp>
#include <boost/math/distributions/students_t.hpp>

namespace isoshift {

double normal_quantile(double upper_tail) { return quantile(complement(boost::math::normal(), upper_tail)); }

double students_t_quantile(double freedom, double upper_tail) {
  return quantile(complement(boost::math::students_t(freedom), upper_tail));
}

double students_t_tail(double freedom, double t) { return cdf(complement(boost::math::students_t(freedom), t)); }

ShareBounds clopper_pearson(double trials, double successes, double tail) {
  using Binomial = boost::math::binomial_distribution<>;
  return {.low = Binomial::find_lower_bound_on_p(trials, successes, tail),
          .high = Binomial::find_upper_bound_on_p(trials, successes, tail)};
}

}  // namespace isoshift
