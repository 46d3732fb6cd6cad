#pragma once
// Which study the user means, and which values the user supplies for it, for every command that reads a study.

#include <span>
#include <string>
#include <vector>

#include "io/study/study.h"
#include "workflow/observer.h"

namespace isoshift {

// Throws UsageError if one of the values of a flag is not finite.
void check_finite(const std::string& flag, std::span<const double> values);

// Throws UsageError for an angle of the couch at imaging that no couch has, in degrees, IEC 61217.
void check_couch_angles(const std::optional<double>& couch_angle_deg, const std::optional<double>& couch_pitch_deg,
                        const std::optional<double>& couch_roll_deg);

// Empty: none. Throws UsageError for a key without a profile, and Error as read_machine_profile() does.
std::optional<MachineProfile> named_machine(const std::filesystem::path& profile, const std::filesystem::path& key);

// What --allow KEY=REASON says. Throws UsageError for a key that no check has.
Allowances allowances_from(std::span<const std::string> allow);

struct StudyOptions {
  StudyParts parts;
  std::filesystem::path machine, machine_key;
  std::vector<double> isocenter, rt_image_position;
  std::vector<std::string> gantry_angles, allow;
  std::string patient_position, intensity, beam;
  std::optional<double> couch_angle_deg, couch_pitch_deg, couch_roll_deg, sad_mm, sid_mm;
  bool assume_centered = false;
  double max_span_s = kDefaultUntoldSpanS;  // from the site file; there is no flag

  // Throws UsageError for a word that is not allowed, a number that is not finite, or if no study is named.
  StudyRequest request() const;

 private:
  void check_numbers() const;
};

// Loads the study and tells the observer which files were left aside.
Study load(const StudyOptions& options, Notes& notes, Observer& observer, CtStore& cts);
inline Study load(const StudyOptions& options, Notes& notes, Observer& observer) {
  CtStore none;
  return load(options, notes, observer, none);
}

// The beam qualities of the study's X-rays.
std::vector<Beam> beams_of(const Study& study);

}  // namespace isoshift
