#pragma once
// What registrations of patients tell of the imagers that took their X-rays. An error of an imager looks like a motion
// of the patient; views that look from elsewhere, or that have other errors, do not want that motion. Of an error that
// all views take for one and the same motion of the patient nothing can be told.

#include <span>
#include <string>
#include <vector>

#include "geometry/imager_error.h"
#include "registration/imager/imager_estimate.h"
#include "setup/registration.h"

namespace isoshift {

struct PatientView {
  ImagerModel model;
  std::size_t imager = 0;  // of those that are estimated
  WantedMotion wanted;
};

struct PatientSession {
  std::string ct;  // sessions of one CT may share what is wrong with it, or how the patient bends
  std::vector<PatientView> views;
};

struct ImagersOfPatients {
  std::vector<ImagerEstimate> imagers;
  std::vector<std::size_t> cts;  // of each imager: those of the patients whom it saw
  // Root mean square of what the views want beyond what they are expected to, in their own sigmas: 1 if they are right.
  double misfit = 0.0;
};

// Least squares over sessions, whose poses are free; misfits of sessions are taken to have a multivariate
// t-distribution (Lange, Little, Taylor, "Robust statistical modeling using the t distribution", J Am Stat Assoc 84
// (1989) 881-896), so that sessions of bent patients count less. Sigmas are those of the least squares, with the misfit
// if it is above 1, or those of a jackknife over CTs, whichever is larger. Of an imager fewer CTs than kLeastCts
// determine nothing, and a single CT determines no error: what is wrong with it is in all of its sessions. The
// longitudinal shift, the distance and the tilts are never determined: only balls tell them. `imagers`: their number.
// Throws Error if no session has two views.
inline constexpr std::size_t kLeastCts = 4;
ImagersOfPatients imagers_of_patients(std::span<const PatientSession> sessions, std::size_t imagers);

}  // namespace isoshift
