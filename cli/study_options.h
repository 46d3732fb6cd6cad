#pragma once
// The flags that name a study's parts, supply what its files lack and allow what checks forbid: the same for every
// command that reads a study.

#include <CLI/CLI.hpp>
#include <map>
#include <string>
#include <vector>

#include "cli/console.h"
#include "io/study.h"

namespace isoshift {

struct StudyOptions {
  std::filesystem::path study, plan, structures, machine;
  std::vector<std::filesystem::path> ct, images;
  std::vector<double> isocenter, rt_image_position;
  std::vector<std::string> gantry_angles, allow;
  std::string patient_position, intensity, beam;
  std::optional<double> couch_angle_deg, couch_pitch_deg, couch_roll_deg, sad_mm, sid_mm;
  bool assume_centered = false;

  // Throws UsageError for a word that is none of those allowed, a number that is not finite, or no study at all.
  StudyRequest request() const;

 private:
  void check_finite() const;
};
void add_study_options(CLI::App& command, StudyOptions& options);
// Those that do not name its parts.
void add_study_switches(CLI::App& command, StudyOptions& options);

// Loads the study behind a progress bar.
Study load(const StudyOptions& options, Notes& notes, Console& console, CtStore& cts);
inline Study load(const StudyOptions& options, Notes& notes, Console& console) {
  CtStore none;
  return load(options, notes, console, none);
}

// The beam qualities of its X-rays.
std::vector<Beam> beams_of(const Study& study);

}  // namespace isoshift
