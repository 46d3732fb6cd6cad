#include "setup/setup_errors.h"

#include <cmath>
#include <utility>

namespace isoshift {
namespace {

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

// Of a sample: divided by one less than its size.
double sd_of(const std::vector<double>& values) {
  const double mean = mean_of(values);
  double sum = 0.0;
  for (const double value : values) sum += (value - mean) * (value - mean);
  return std::sqrt(sum / static_cast<double>(values.size() - 1));
}

}  // namespace

PatientErrors errors_of_patient(std::string patient, std::vector<ErrorComponents> fractions) {
  PatientErrors errors{.patient = std::move(patient), .fractions = std::move(fractions)};
  if (errors.fractions.size() > 1) errors.sd.emplace();
  for (std::size_t component = 0; component < kErrorComponents.size(); ++component) {
    std::vector<double> values;
    values.reserve(errors.fractions.size());
    for (const ErrorComponents& fraction : errors.fractions) values.push_back(fraction[component]);
    errors.mean[component] = mean_of(values);
    if (errors.sd) (*errors.sd)[component] = sd_of(values);
  }
  return errors;
}

std::optional<PopulationErrors> errors_of_population(const std::vector<PatientErrors>& patients) {
  PopulationErrors population;
  for (std::size_t component = 0; component < kErrorComponents.size(); ++component) {
    std::vector<double> means, variances;
    for (const PatientErrors& patient : patients) {
      if (!patient.sd) continue;
      means.push_back(patient.mean[component]);
      variances.push_back((*patient.sd)[component] * (*patient.sd)[component]);
    }
    if (means.size() < 2) return std::nullopt;
    population.patients = means.size();
    population.mean[component] = mean_of(means);
    population.systematic[component] = sd_of(means);
    population.random[component] = std::sqrt(mean_of(variances));
  }
  return population;
}

std::array<double, 3> van_herk_margin_mm(const PopulationErrors& population) {
  std::array<double, 3> margin_mm{};
  for (std::size_t axis = 0; axis < margin_mm.size(); ++axis)
    margin_mm[axis] = 2.5 * population.systematic[axis] + 0.7 * population.random[axis];
  return margin_mm;
}

}  // namespace isoshift
