#pragma once
// How well two ways of measuring one quantity agree: bias and spread of their differences (Bland and Altman, Lancet
// 327, 1986), and of a share its exact bounds (Clopper and Pearson, Biometrika 26, 1934).

#include <cstddef>
#include <optional>
#include <span>

namespace isoshift {

struct Agreement {
  std::size_t count = 0;
  double bias = 0.0;  // mean of the differences
  // Unset with fewer than two differences:
  std::optional<double> sd;           // of a difference
  std::optional<double> bias_within;  // half the width of the bias's 95 % confidence interval (Student's t)
  std::optional<double> limit;        // 95 % limits of agreement lie at bias -/+ this: 1.96 sd
};

// Of independent differences. Precondition: there is a difference.
Agreement agreement_of(std::span<const double> differences);

// Of differences that are alike in one patient: `patients` has a number for each. The bias's interval is that of the
// patients' means, each weighted by its differences (the ultimate cluster estimate: Hansen, Hurwitz, Madow, "Sample
// survey methods and theory" I, 1953), and is unset for a single patient.
Agreement agreement_of(std::span<const double> differences, std::span<const std::size_t> patients);

struct Share {
  std::size_t of = 0, total = 0;
  double low = 0.0, high = 1.0;  // 95 % confidence interval

  double value() const { return static_cast<double>(of) / static_cast<double>(total); }
};

// The number of sigmas that one of so many independent normal errors exceeds in one case of a hundred.
double sigmas_hardly_exceeded(std::size_t errors);

// Precondition: of <= total, and total is positive.
Share share_of(std::size_t of, std::size_t total);

}  // namespace isoshift
