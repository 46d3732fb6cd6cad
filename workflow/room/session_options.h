#pragma once
// What a person may choose for a session, where the files do not tell.

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "io/study/session_files.h"
#include "io/study/study_files.h"
#include "workflow/room/choice.h"

namespace isoshift {

// What a person chooses by the IDs of candidates, each empty where the files tell.
struct ChosenIds {
  std::set<std::string> xrays;
  std::string patient, plan, ct;

  bool operator==(const ChosenIds&) const = default;
};

struct SessionOptions {
  std::vector<Candidate> own_xrays, other_xrays;  // of the session, and others of the patient
  std::vector<Candidate> patients, plans, cts;    // as in Choice; empty where the files tell
  std::optional<ChosenIds> chosen;                // by the choice that stands
  bool is_regrouped = false;                      // by that choice

  bool is_anything() const {
    return chosen || !other_xrays.empty() || !patients.empty() || !plans.empty() || !cts.empty();
  }
  bool operator==(const SessionOptions&) const = default;
};

// The X-rays that were registered or deleted: where, by SOPInstanceUID; an empty name: their results were deleted.
using SessionOfXray = std::map<std::string, std::string>;

// `own`: the files of the session, as files_for() finds them; `files`: all of its patient; `standing`: the choice that
// stands, or null.
SessionOptions options_of(const SessionFiles& session, const StudyFiles& own, const StudyFiles& files,
                          bool takes_other_xrays, const SessionOfXray& session_of, const Choice* standing);

nlohmann::ordered_json json_of(const SessionOptions& options);
// Throws nlohmann::json::exception for anything else.
SessionOptions session_options_from(const nlohmann::json& json);

// Throws Error if one of the IDs is not among the options, if none of the X-rays is the session's own, or if nothing is
// chosen and no choice stands.
Choice chosen_from(const SessionOptions& options, const ChosenIds& ids);

}  // namespace isoshift
