#include "setup/setup_errors.h"

#include <cmath>
#include <utility>

#include "base/mean_and_sd.h"

namespace isoshift {

PatientErrors errors_of_patient(std::string patient, std::vector<ErrorComponents> fractions) {
  PatientErrors errors{.patient = std::move(patient), .fractions = std::move(fractions)};
  if (errors.fractions.size() > 1) errors.sd.emplace();
  for (std::size_t component = 0; component < kErrorComponents.size(); ++component) {
    std::vector<double> values;
    values.reserve(errors.fractions.size());
    for (const ErrorComponents& fraction : errors.fractions) values.push_back(fraction[component]);
    const auto [mean, sd] = mean_and_sd_of(values);
    errors.mean[component] = mean;
    if (errors.sd) (*errors.sd)[component] = sd;
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
    const auto [mean, sd] = mean_and_sd_of(means);
    population.mean[component] = mean;
    population.systematic[component] = sd;
    population.random[component] = std::sqrt(mean_and_sd_of(variances).mean);
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
