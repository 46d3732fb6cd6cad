#include "setup/agreement.h"

#include <cmath>
#include <map>

#include "base/distributions.h"
#include "base/mean_and_sd.h"

namespace isoshift {
namespace {

constexpr double kTail = 0.025;  // on each side of a 95 % interval

// Standard errors that half of the 95 % interval is wide.
double standard_errors(std::size_t freedom) { return students_t_quantile(static_cast<double>(freedom), kTail); }

}  // namespace

Agreement agreement_of(std::span<const double> differences) {
  Agreement agreement{.count = differences.size()};
  const auto count = static_cast<double>(differences.size());
  const auto [bias, sd] = mean_and_sd_of(differences);
  agreement.bias = bias;
  if (differences.size() < 2) return agreement;
  agreement.sd = sd;
  agreement.bias_within = standard_errors(differences.size() - 1) * sd / std::sqrt(count);
  agreement.limit = 1.96 * sd;
  return agreement;
}

Agreement agreement_of(std::span<const double> differences, std::span<const std::size_t> patients) {
  Agreement agreement = agreement_of(differences);
  agreement.bias_within.reset();
  std::map<std::size_t, double> off;  // by patient, the sum of the differences from the bias
  for (std::size_t n = 0; n < differences.size(); ++n) off[patients[n]] += differences[n] - agreement.bias;
  if (off.size() < 2) return agreement;
  const auto count = static_cast<double>(differences.size()), clusters = static_cast<double>(off.size());
  double squares = 0.0;
  for (const auto& [patient, sum] : off) squares += sum * sum;
  agreement.bias_within = standard_errors(off.size() - 1) * std::sqrt(clusters / (clusters - 1.0) * squares) / count;
  return agreement;
}

double sigmas_hardly_exceeded(std::size_t errors) {
  constexpr double kCases = 0.01;
  return normal_quantile(0.5 * kCases / static_cast<double>(errors));
}

Share share_of(std::size_t of, std::size_t total) {
  const ShareBounds bounds = clopper_pearson(static_cast<double>(total), static_cast<double>(of), kTail);
  return {.of = of, .total = total, .low = bounds.low, .high = bounds.high};
}

}  // namespace isoshift
