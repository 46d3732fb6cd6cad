#pragma once
// Follows a moving target through X-rays over time, and records its measured and its predicted positions.

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
  RegistrationRequest registration;  // after settle(); only its region and its rendering are used
  TrackingOptions tracking;
  std::filesystem::path output;
  std::filesystem::path follow;               // a folder that is being filled; empty: the X-rays of the study
  std::filesystem::path truth;                // true positions; empty: unknown
  std::vector<std::filesystem::path> phases;  // folders of the phases of a 4D CT, in order
  double together_s = 0.05;                   // X-rays of several imagers within this time are one moment
  double budget_s = 0.2;                      // moments that take longer are counted
  double idle_s = 5.0;                        // with `follow`: ends after this time without an X-ray
  std::optional<double> tolerance_mm;         // the beam would wait while the target is farther off than this
  bool overwrite = false;
};

// Writes trace.csv, track.json and trace.svg. Ends after the last X-ray, or when the program is asked to end. Throws
// Error if the target was not found in any moment.
TrackRecord track_study(const TrackOptions& options, Observer& observer);

}  // namespace isoshift
