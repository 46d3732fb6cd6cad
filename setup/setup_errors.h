#pragma once
// Systematic and random setup errors over the fractions of patients, as the IGRT literature defines them (van Herk,
// Semin Radiat Oncol 14, 2004): a patient's systematic error is the mean over its fractions, its random error their
// standard deviation. Of a population, M is the mean of the means, Sigma their standard deviation, and sigma the root
// mean square of the random errors.

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace isoshift {

inline constexpr std::array kErrorComponents = {"x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"};
using ErrorComponents = std::array<double, 6>;  // IEC 61217 fixed

struct PatientErrors {
  std::string patient;
  std::vector<ErrorComponents> fractions;  // in order of time
  ErrorComponents mean{};                  // systematic
  std::optional<ErrorComponents> sd;       // random; unset: one fraction
};

struct PopulationErrors {
  std::size_t patients = 0;      // number of patients with two fractions or more
  ErrorComponents mean{};        // M
  ErrorComponents systematic{};  // Sigma
  ErrorComponents random{};      // sigma
};

PatientErrors errors_of_patient(std::string patient, std::vector<ErrorComponents> fractions);

// Unset with fewer than two patients that have two fractions or more.
std::optional<PopulationErrors> errors_of_population(const std::vector<PatientErrors>& patients);

// The margin about the target for translations along x, y and z: 2.5 Sigma + 0.7 sigma (van Herk et al., Int J Radiat
// Oncol Biol Phys 47, 2000). With it, 90 % of the patients get at least 95 % of the dose in all of the target, if
// errors are normal, fractions many, the target large and rigid, and the penumbra that of a photon beam in water (3.2
// mm). M is not in it: an error that all patients share is to be removed.
std::array<double, 3> van_herk_margin_mm(const PopulationErrors& population);

}  // namespace isoshift
