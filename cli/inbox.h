#pragma once
// The files of many patients as they come, from a folder or an Orthanc server, in any order, some twice, some broken.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "io/notes.h"
#include "io/orthanc.h"
#include "io/study_files.h"
#include "io/watch_file.h"

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
  // between two calls. Throws Error for a server that does not answer; the next call goes on.
  void update(Notes& notes);

  // Nothing more is known to be on its way: files that grow, changes that the server has not told, instances that it
  // did not give.
  bool is_settled() const { return growing_.empty() && unfetched_.empty() && has_all_changes_; }

  // By what StudyFiles calls a patient.
  const std::map<std::string, Patient>& patients() const { return patients_; }

  // The next update asks a server what else it has of a patient, once after each object that comes: what was forgotten
  // is fetched again.
  void ask_for_rest(const std::string& patient) { rest_.emplace(patient, false); }

  // Removes the objects of patients of whom nothing has come since; a server is asked for them again where they are
  // needed. What lies in a folder is not touched.
  void forget_before(std::filesystem::file_time_type time);

 private:
  struct Version {
    std::uintmax_t size = 0;
    std::filesystem::file_time_type written;
    bool operator==(const Version&) const = default;
  };
  struct Known {
    std::string patient, uid;  // SOPInstanceUID
  };
  // Of one file; nothing for one that is no part of a study.
  static std::optional<Known> known_in(const StudyFiles& one);
  void update_folder(Notes& notes);
  void update_orthanc(Notes& notes);
  void find_rest(const std::string& patient);
  void fetch(const std::string& instance, Notes& notes);
  void take(const std::filesystem::path& file, Notes& notes);
  void forget(const std::filesystem::path& file);

  const WatchFile& watch_;
  std::filesystem::path objects_;
  std::unique_ptr<Orthanc> orthanc_;
  std::map<std::string, Patient> patients_;
  std::map<std::filesystem::path, Known> known_;
  std::map<std::string, std::filesystem::path> file_of_uid_;     // of those known
  std::multimap<std::string, std::filesystem::path> copies_of_;  // of a SOPInstanceUID, left out
  std::map<std::filesystem::path, Version> done_, growing_;      // in a folder
  std::map<std::string, int> unfetched_;                         // instances, and how often that was tried
  std::map<std::string, bool> rest_;                             // patients to be asked for, and whether that was done
  bool has_all_changes_ = true, has_read_objects_ = false;
  std::int64_t last_change_ = 0, saved_change_ = 0;
};

}  // namespace isoshift
