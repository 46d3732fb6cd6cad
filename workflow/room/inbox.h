#pragma once
// The files of many patients as they come, from a folder or an Orthanc server, in any order, some twice, some broken.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>

#include "base/backoff.h"
#include "io/config/watch_file.h"
#include "io/dicom/notes.h"
#include "io/network/orthanc.h"
#include "io/study/study_files.h"

namespace isoshift {

class Inbox {
 public:
  using Clock = std::chrono::steady_clock;
  struct Patient {
    StudyFiles files;
    Clock::time_point last;  // when one of them came last
  };

  // What comes from a server is kept in `objects`.
  Inbox(const WatchFile& watch, std::filesystem::path objects);

  // Takes what has come since the last call, and forgets what is there no more. A file counts once it has not changed
  // between two calls. Throws Error for a server that does not answer or a disk that is full; the next call goes on.
  void update(Notes& notes);

  // By PatientID.
  const std::map<std::string, Patient>& patients() const { return patients_; }

  // Something of this patient, or of nobody knows whom, is on its way: files that grow, changes that the server has not
  // told, instances that it did not give yet. What is of nobody knows whom counts for a minute.
  bool is_coming(const std::string& patient_id) const;

  // The next update asks a server what else it has of a patient, once after each object that comes: what was forgotten
  // is fetched again.
  void ask_for_rest(const std::string& patient_id) { rest_.emplace(patient_id, Clock::time_point()); }

  // Removes the objects of patients of whom nothing has come since; a server is asked for them again where they are
  // needed. What lies in a folder is not touched.
  void forget_before(std::filesystem::file_time_type time);

 private:
  struct Version {
    std::uintmax_t size = 0;
    std::filesystem::file_time_type written;
    bool operator==(const Version&) const = default;
  };
  struct Growing {
    Version version;
    Clock::time_point since;
    std::string patient_id;  // empty: unknown
  };
  struct Known {
    std::string patient_id, uid;  // SOPInstanceUID
  };
  struct Attempts {
    int count = 0;
    Clock::time_point since;
    Backoff again{std::chrono::seconds(1), std::chrono::minutes(10)};
  };
  // Of one file; nothing for one that is no part of a study.
  static std::optional<Known> known_in(const StudyFiles& one);
  static Growing growing(const std::filesystem::path& file, const Version& version);

  void update_folder(Notes& notes);
  void update_orthanc(Notes& notes);
  void read_objects(Notes& notes);
  void fetch(const std::string& instance, Notes& notes);
  void find_rest(const std::string& patient_id, Notes& notes);
  void save_state();
  void check_server(Notes& notes);
  // Both tell whether it can be read.
  bool keep(const std::filesystem::path& object, Notes& notes);
  bool take(const std::filesystem::path& file, Notes& notes);
  void forget(const std::filesystem::path& file);

  const WatchFile& watch_;
  std::filesystem::path objects_;
  std::unique_ptr<Orthanc> orthanc_;
  std::map<std::string, Patient> patients_;
  std::map<std::filesystem::path, Known> known_;
  std::map<std::string, std::filesystem::path> file_of_uid_;     // of those known
  std::multimap<std::string, std::filesystem::path> copies_of_;  // of a SOPInstanceUID, left out

  // Of a folder.
  std::map<std::filesystem::path, Version> done_;
  std::map<std::filesystem::path, Growing> growing_;
  std::set<std::filesystem::path> unopened_;  // files and folders

  // Of a server.
  std::int64_t last_change_ = 0;
  std::string last_mark_;
  std::map<std::string, Attempts> unfetched_;      // instances
  std::map<std::string, Clock::time_point> rest_;  // patients to be asked for, and when
  std::set<std::string> useless_;                  // instances that are no part of a study
  bool has_all_changes_ = true, has_read_objects_ = false, has_checked_server_ = false;
  std::string saved_state_;
};

}  // namespace isoshift
