#pragma once
// A session of an archive, with what isoshift found and what the clinic used.

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "io/objects/registration_meaning.h"
#include "setup/identity.h"
#include "setup/setup_errors.h"
#include "setup/verdict.h"
#include "workflow/audit_setup/couch_axes.h"

namespace isoshift {

struct AuditedSession {
  std::string name;                  // of its folder; with the folders above where two folders have one name
  std::filesystem::path folder;      // of the result
  std::string acquired;              // when the first X-ray was taken, "2026-03-01 10:15:00"; empty: unknown
  double day = 0.0;                  // the same, in days since 1970
  std::optional<Verdict> verdict;    // nothing: the result cannot be read
  std::vector<std::string> reasons;  // why it was not accepted
  std::string left_out;              // why it does not count; empty: it does

  // What isoshift found, and one standard deviation of it. Components that are not determined are empty.
  CouchAxes found, sigma;
  std::optional<ErrorComponents> setup_error;  // all six components; empty where one is not determined
  bool is_first_of_day = true;  // of the patient: later sessions of a day show what the couch shift has left

  CouchAxes used;            // the couch shift that the clinic applied
  std::string used_from;     // the file that says so
  std::string not_compared;  // why there is nothing to compare with, although it counts; empty: there is

  // What registration objects are matched by, and need to become a couch shift.
  Identity identity;
  std::set<std::string> xrays;  // SOPInstanceUIDs
  std::string ct_frame_uid;     // FrameOfReferenceUID; empty: not known
  PlannedSetup planned;

  std::string verdict_in_words() const { return verdict ? std::string(to_string(*verdict)) : "unreadable"; }
  bool counts() const { return left_out.empty(); }
  // Used minus found: where the used shift would leave the patient, if isoshift is right. Empty where one is not known.
  CouchAxes difference() const;
  bool is_compared() const;
};

}  // namespace isoshift
