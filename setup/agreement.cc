#include "setup/agreement.h"

#include <boost/math/distributions/binomial.hpp>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>

#include "base/mean_and_sd.h"

namespace isoshift {
namespace {

constexpr double kTail = 0.025;  // on each side of a 95 % interval

}  // namespace

Agreement agreement_of(std::span<const double> differences) {
  Agreement agreement{.count = differences.size()};
  const auto count = static_cast<double>(differences.size());
  const auto [bias, sd] = mean_and_sd_of(differences);
  agreement.bias = bias;
  if (differences.size() < 2) return agreement;
  const boost::math::students_t t(count - 1.0);
  agreement.sd = sd;
  agreement.bias_within = quantile(complement(t, kTail)) * sd / std::sqrt(count);
  agreement.limit = 1.96 * sd;
  return agreement;
}

Share share_of(std::size_t of, std::size_t total) {
  using Binomial = boost::math::binomial_distribution<>;
  const auto trials = static_cast<double>(total), successes = static_cast<double>(of);
  return {.of = of,
          .total = total,
          .low = Binomial::find_lower_bound_on_p(trials, successes, kTail),
          .high = Binomial::find_upper_bound_on_p(trials, successes, kTail)};
}

}  // namespace isoshift
