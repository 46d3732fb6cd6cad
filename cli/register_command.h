#pragma once
// isoshift register: from an exported study to a setup shift.

#include <filesystem>
#include <optional>
#include <string>

#include "cli/console.h"
#include "cli/registration_setup.h"
#include "cli/study_options.h"
#include "io/report/setup_report.h"
#include "io/spatial_registration.h"

namespace isoshift {

struct RegisterOptions {
  StudyOptions study;
  RegistrationFlags flags;
  std::filesystem::path output;
  std::filesystem::path site;  // empty: no site file
  std::string anatomy;
  bool overwrite = false;
  bool write_reg_for_review = false;
  bool accept_unobservable = false;
  RegistrationSource source = RegistrationSource::kTreatment;
};

// What registrations of one process share where they can.
struct SharedWork {
  CtStore cts;
  RendererStore renderers;
};

// Registers a study and writes the folder of its result, whole or not at all. The flags must have been
// settled.
SetupReport register_study(const RegisterOptions& options, SharedWork& shared, Console& console);

// The flags beside those of the study and of registration that decide what is written.
void add_result_options(CLI::App& command, RegisterOptions& options);

// The exit status that a verdict asks for.
int exit_status_of(Verdict verdict);

}  // namespace isoshift
