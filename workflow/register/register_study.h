#pragma once
// From an exported study to the folder of its result. isoshift register, batch and watch use this for each study.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/objects/spatial_registration.h"
#include "setup/setup_result.h"
#include "workflow/observer.h"
#include "workflow/register/registration_setup.h"
#include "workflow/register/study_options.h"

namespace isoshift {

struct RegisterOptions {
  StudyOptions study;
  RegistrationRequest registration;
  std::filesystem::path output;
  std::filesystem::path site;  // empty: no site file
  std::string anatomy;
  std::filesystem::path start;           // a pose (start_pose.h); empty: the planned one
  std::vector<double> source_isocenter;  // of a Spatial Registration in it; empty: as it or the X-rays tell
  std::filesystem::path truth;           // must be about the study's setup; empty: nobody knows
  std::string target;  // the structure that the setup must bring right, or "isocenter"; empty: as target_of() finds it
  bool overwrite = false;
  bool write_reg_for_review = false;
  bool accept_unobservable = false;
  RegistrationSource source = RegistrationSource::kTreatment;
};

// Work that the registrations of one process can share.
struct SharedWork {
  CtStore cts;
  RendererStore renderers;
  BodyStore bodies;
};

// Registers a study that is loaded, and writes nothing. `options` say how; the study and the site are those given here.
// Precondition: as of register_study().
SetupResult register_loaded(const Study& study, const RegisterOptions& options, const std::optional<SiteRules>& site,
                            std::optional<Start> start, SharedWork& shared, Observer& observer);

// Writes the registration object of a result, as accepted or, where that is asked for, as one for review, and returns
// its SOP Instance UID; empty where the result may not be written. A direction that was not measured is an override.
std::string write_registration(const RegisterOptions& options, const Study& study, const SetupResult& result,
                               const std::filesystem::path& path, Notes& notes);

// Registers a study and writes the folder of its result, whole or not at all. Precondition:
// `options.registration.settle()` has been called.
SetupResult register_study(const RegisterOptions& options, SharedWork& shared, Observer& observer);

}  // namespace isoshift
