#pragma once
// Which X-rays of a patient make a session, as a person has chosen or else as they were taken, and which of them have a
// result.

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "io/study/session_files.h"
#include "io/study/study_files.h"
#include "workflow/room/choice.h"
#include "workflow/room/session_options.h"

namespace isoshift {

// X-rays are named by their SOPInstanceUIDs, sessions by the name of the first result of their X-rays.
class Grouping {
 public:
  // `takes_other_xrays`: a machine profile supplies the geometry of X-rays that are not RT Images.
  explicit Grouping(bool takes_other_xrays) : takes_other_xrays_(takes_other_xrays) {}

  void add_result(const std::string& session, const std::set<std::string>& xrays);
  // X-rays whose results were deleted, as SHA-256 of their SOPInstanceUIDs. They are not registered again.
  void add_deleted(const std::set<std::string>& sha256);
  // Takes out all results of these X-rays.
  void remove(const std::string& session);
  // By session, also those that were withdrawn. Replaces what was chosen before.
  void set_choices(std::map<std::string, Choice> choices) { choices_ = std::move(choices); }
  // What a person has chosen for a session, in words. Empty: nothing.
  std::string choice_in_words(const std::string& session) const;
  bool is_regrouped(const std::string& session) const;  // by choice

  // X-rays that have a result, or had one that was deleted, among those seen by see().
  const std::set<std::string>& registered() const { return registered_; }
  // Finds the X-rays whose results were deleted.
  void see(const StudyFiles& files);
  // Whether none of the files is an X-ray that is still to be registered.
  bool are_all_registered(const StudyFiles& files) const;

  // The sessions among a patient's files that have no result.
  std::vector<SessionFiles> sessions_in(const StudyFiles& files) const;
  // The sessions that have a result and rest on a choice, or did until it was withdrawn, as far as their X-rays are
  // among the files.
  std::vector<SessionFiles> chosen_in(const StudyFiles& files) const;
  // The sessions that have a result and of which X-rays are among the files.
  std::set<std::string> registered_in(const StudyFiles& files) const;
  // The X-rays among a patient's files that have a result: the session by SOPInstanceUID.
  std::map<std::string, std::string> results_of(const StudyFiles& files) const;
  // The X-rays of a result as a session; nothing if they would be grouped in another way now.
  std::optional<SessionFiles> registered_session(const std::string& session, const StudyFiles& files) const;

  // The files from which the parts of a session are chosen (choose_parts()).
  StudyFiles files_of(const SessionFiles& session, const StudyFiles& files) const;
  // What of them is known to be missing, in words.
  std::vector<std::string> missing_of(const SessionFiles& session, const StudyFiles& own) const;
  // Flags of isoshift register by which a person's choice for the session stands.
  std::vector<std::string> flags_of(const SessionFiles& session) const;
  // Plans and CTs for the session that came after a person had chosen among others, in words.
  std::vector<std::string> came_after_choice(const SessionFiles& session, const StudyFiles& files) const;
  // What a person may choose for it.
  SessionOptions options_of(const SessionFiles& session, const StudyFiles& files) const;

 private:
  const Choice* choice_for(const std::string& session) const;  // null: there is none that stands

  bool takes_other_xrays_;
  std::map<std::string, std::set<std::string>> results_;  // X-rays, by session
  SessionOfXray session_of_;                              // the last session of an X-ray
  std::set<std::string> registered_;
  std::set<std::string> deleted_;  // SHA-256
  std::map<std::string, Choice> choices_;
};

}  // namespace isoshift
