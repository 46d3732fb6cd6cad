#pragma once
// Follows a moving target through X-rays over time, and writes down where it was and where it was predicted to be.

#include <filesystem>
#include <optional>
#include <vector>

#include "registration/motion/tracker.h"
#include "workflow/observer.h"
#include "workflow/register/registration_setup.h"
#include "workflow/register/study_options.h"
#include "workflow/track/track_record.h"

namespace isoshift {

struct TrackOptions {
  StudyOptions study;
  RegistrationRequest registration;  // settled; of it what is followed and how it is rendered
  TrackingOptions tracking;
  std::filesystem::path output;
  std::filesystem::path follow;               // a folder that is being filled with X-rays; empty: those of the study
  std::filesystem::path truth;                // true positions; empty: unknown
  std::vector<std::filesystem::path> phases;  // folders of the phases of a 4D CT, in order
  double together_s = 0.05;                   // X-rays of several imagers are of one moment within this
  double budget_s = 0.2;                      // moments that take longer are counted
  double idle_s = 5.0;                        // a folder that is being filled: ends after so long without an X-ray
  std::optional<double> tolerance_mm;         // the beam would wait for a target farther off
  bool overwrite = false;
};

// Writes trace.csv, track.json and trace.svg. Ends with the X-rays, or when the program is asked to end. Throws Error
// where the target was found in no moment.
TrackRecord track_study(const TrackOptions& options, Observer& observer);

}  // namespace isoshift
