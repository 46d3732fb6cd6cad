#pragma once
// What the other X-rays of a patient say against a result: the couch may have moved since the result's X-rays were
// taken, or between them.

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "setup/setup_result.h"
#include "workflow/room/results_tree.h"
#include "workflow/room/source.h"

namespace isoshift {

class Objections {
 public:
  // `earlier`: what by_session() returned in an earlier run.
  Objections(std::map<std::string, Objection> earlier, bool takes_other_xrays)
      : by_session_(std::move(earlier)), takes_other_xrays_(takes_other_xrays) {}

  // `is_regrouped`: a person has made its X-rays a session.
  void add_result(const std::string& session, const SetupResult& result, bool is_regrouped = false);

  // That the files of a result are others now, in words. It counts with the next update().
  void add(const std::string& session, const std::string& words);

  // What was added against a result speaks against another one, too, which rests on it.
  void inherit(const std::string& from, const std::string& session);

  // Forgets all results of these X-rays. The X-rays count on.
  void remove(const std::string& first_session);

  // Looks at the X-rays that have arrived, by PatientID. `registered`: the SOPInstanceUIDs of those that have a result.
  void update(const std::map<std::string, Patient>& patients, const std::set<std::string>& registered);

  // The sessions that have a result, of patients of whom `is_asked_for` is true.
  std::set<std::string> sessions_of(const std::function<bool(const std::string& patient_id)>& is_asked_for) const;

  // An objection is never withdrawn, and X-rays that are moved away count on: they have been taken all the same.
  const std::map<std::string, Objection>& by_session() const { return by_session_; }

 private:
  struct Moment {
    std::optional<double> at_s;          // since an epoch
    std::optional<double> local_s;       // the same without the offset from UTC
    std::optional<bool> has_utc_offset;  // unset: not known, because only a result tells of the X-ray
  };
  // Its UID and its time: if one UID comes with two times, it is that of two X-rays.
  using Xray = std::pair<std::string, std::string>;
  struct Seen {
    std::string label;
    Moment moment;
    std::optional<StudyFiles::Image> image;  // unset: only a result tells of it
    bool is_rt_image = true;
  };
  struct OfPatient {
    std::map<Xray, Seen> xrays;
    std::map<std::string, std::set<Xray>> results;  // by session
    // Sessions whose X-rays a person has grouped, with the reasons that their results give.
    std::map<std::string, std::vector<std::string>> regrouped;
    std::optional<Clock::Time> looked_at;  // Patient::last at that time
    bool is_news = false;                  // files or results that were not compared yet
  };
  // Notes the X-rays. Takes over what is known of a result of one of them: a PatientID outside ASCII may read
  // differently in a result than in a file.
  void see(const std::string& patient_id, const StudyFiles& files);
  static bool may_be_later(const Moment& moment, const Moment& than);
  static Objection newer_xrays(const OfPatient& patient, const std::set<Xray>& own,
                               const std::set<std::string>& registered);
  static std::string shared_xrays(const OfPatient& patient, const std::string& session);
  static bool is_of_other_issuer(const OfPatient& patient, const std::set<Xray>& own, const Seen& other);
  static bool are_seen(const OfPatient& patient, const std::set<Xray>& own);
  Objection objection(const OfPatient& patient, const std::string& session,
                      const std::set<std::string>& registered) const;

  std::map<std::string, Objection> by_session_;
  std::map<std::string, std::vector<std::string>> added_;  // in words, by session
  bool takes_other_xrays_;
  std::map<std::string, OfPatient> patients_;          // by PatientID
  std::map<std::string, std::string> patient_of_uid_;  // PatientID, by the SOPInstanceUID of an X-ray that has a result
};

}  // namespace isoshift
