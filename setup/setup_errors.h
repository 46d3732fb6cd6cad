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

}  // namespace isoshift
