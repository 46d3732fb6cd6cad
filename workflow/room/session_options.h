#pragma once
// What a person may choose for a session that waits, where the files do not tell.

#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "io/study/session_files.h"
#include "io/study/study_files.h"
#include "workflow/room/choice.h"

namespace isoshift {

struct SessionOptions {
  std::vector<Candidate> own_xrays, other_xrays;  // of the session, and others of the patient
  std::vector<Candidate> patients, plans, cts;    // as in Choice; empty where the files tell

  bool is_anything() const { return !other_xrays.empty() || !patients.empty() || !plans.empty() || !cts.empty(); }
  bool operator==(const SessionOptions&) const = default;
};

// `own`: the files of the session, as files_for() finds them; `files`: all of its patient; `session_of`: the session in
// which an X-ray was registered, by its SOPInstanceUID.
SessionOptions options_of(const SessionFiles& session, const StudyFiles& own, const StudyFiles& files,
                          bool takes_other_xrays, const std::map<std::string, std::string>& session_of);

nlohmann::ordered_json json_of(const SessionOptions& options);
// Throws nlohmann::json::exception for anything else.
SessionOptions session_options_from(const nlohmann::json& json);

// What a person chooses by the IDs of candidates, each empty where the files tell.
struct ChosenIds {
  std::set<std::string> xrays;
  std::string patient, plan, ct;
};
// Throws Error if one of them is not among the options, or if nothing is chosen.
Choice chosen_from(const SessionOptions& options, const ChosenIds& ids);

}  // namespace isoshift
