#pragma once
// isoshift register: from an exported study to a setup shift.

#include <filesystem>
#include <optional>
#include <string>

#include "cli/console.h"
#include "cli/registration_setup.h"
#include "cli/study_options.h"
#include "io/spatial_registration.h"

namespace isoshift {

struct RegisterOptions {
  StudyOptions study;
  RegistrationFlags flags;
  std::filesystem::path output;
  std::filesystem::path truth;  // empty: unknown
  std::filesystem::path site;   // empty: no site file
  std::string anatomy;
  bool overwrite = false;
  bool json = false;
  bool write_reg_for_review = false;
  bool accept_unobservable = false;
  RegistrationSource source = RegistrationSource::kTreatment;
};

// Returns the exit status that the verdict asks for.
int run_register(const RegisterOptions& options, Console& console);

}  // namespace isoshift
