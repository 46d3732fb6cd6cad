#pragma once
// What a person chooses for X-rays where the files do not tell: which of them are one setup, whose they are, and which
// plan and CT are meant.

#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "io/study/session_files.h"
#include "io/study/study_files.h"

namespace isoshift {

// Of several that may be meant. Nothing is meant by an empty `id`: the files tell.
struct Candidate {
  std::string id;     // a UID, or "PatientID\issuer" of a patient
  std::string words;  // for people

  bool operator==(const Candidate&) const = default;
};

struct Choice {
  std::string session;            // that the X-rays make
  std::vector<Candidate> xrays;   // SOPInstanceUIDs
  Candidate patient, plan, ct;    // plan: SOPInstanceUID; CT: SeriesInstanceUID
  std::set<std::string> offered;  // UIDs of the plans and CTs among which the person has chosen
  bool is_regrouped = false;      // without the choice these X-rays would not make a session
  bool is_withdrawn = false;      // the choice before does not count any more, and nothing is chosen
  std::string patient_id;         // as the source has it
  std::string reason;             // in the person's words
  std::string by, user;           // the person, and the user of the system
  std::string on;                 // local time

  bool operator==(const Choice&) const = default;
};

// "J. Doe chose on 2026-03-01T10:20:00+0100 for AP 10:15:00 and LAT 11:15:00: that they show one setup (the panel had
// failed)", "J. Doe withdrew on ... the choice for ...".
std::string in_words(const Choice& choice);

nlohmann::ordered_json json_of(const Candidate& candidate);
nlohmann::ordered_json json_of(const Choice& choice);
// These throw nlohmann::json::exception for anything else.
Candidate candidate_from(const nlohmann::json& json);
std::vector<Candidate> candidates_from(const nlohmann::json& json);
Choice choice_from(const nlohmann::json& json);

// The chosen X-rays as a session, which a person must review; nothing while one of them is not among the files.
// `registered`: the SOPInstanceUIDs of X-rays that have a result.
std::optional<SessionFiles> chosen_session(const Choice& choice, const StudyFiles& files, bool other_xrays,
                                           const std::set<std::string>& registered);

// The files of a session without the plans and CTs that were not chosen.
StudyFiles as_chosen(StudyFiles of_session, const Choice& choice);

// What was chosen and has not arrived, in words. Empty: nothing is missing.
std::string missing_of(const Choice& choice, const StudyFiles& as_chosen);

// The flags of isoshift register by which a choice stands although its X-rays lie far apart in time; none if they do
// not.
std::vector<std::string> flags_for(const Choice& choice, const SessionFiles& session);

}  // namespace isoshift
