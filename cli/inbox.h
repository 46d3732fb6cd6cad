#pragma once
// The files of many patients as they come, from a folder or an Orthanc server, in any order, some twice, some broken.

#include <chrono>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <unordered_set>

#include "io/notes.h"
#include "io/orthanc.h"
#include "io/session_files.h"
#include "io/watch_file.h"

namespace isoshift {

class Inbox {
 public:
  using Clock = std::chrono::steady_clock;

  // What comes from a server is kept in `objects`.
  Inbox(const WatchFile& watch, std::filesystem::path objects);

  // Takes what has come since the last call. A file counts once it has not changed between two calls. Throws Error for
  // a server that does not answer; the next call goes on.
  void update(Notes& notes);

  // Nothing more is known to be on its way: files that grow, changes that the server has not told, instances that it
  // did not give.
  bool is_settled() const { return growing_.empty() && unfetched_.empty() && has_all_changes_; }

  const StudyFiles& files() const { return files_; }
  // When the last file of a patient came.
  std::optional<Clock::time_point> last_of(const std::string& patient) const;

 private:
  struct Version {
    std::uintmax_t size = 0;
    std::filesystem::file_time_type written;
    bool operator==(const Version&) const = default;
  };
  void update_folder(Notes& notes);
  void update_orthanc(Notes& notes);
  void fetch(const std::string& instance, Notes& notes);
  void take(const std::filesystem::path& file, Notes& notes);

  const WatchFile& watch_;
  std::filesystem::path objects_;
  std::unique_ptr<Orthanc> orthanc_;
  StudyFiles files_;
  std::map<std::string, std::filesystem::path> file_of_uid_;  // by SOPInstanceUID
  std::unordered_set<std::string> taken_;
  std::map<std::filesystem::path, Version> done_, growing_;
  std::map<std::string, int> unfetched_;  // instances, and how often that was tried
  bool has_all_changes_ = true, has_read_objects_ = false;
  std::map<std::string, Clock::time_point> last_of_;
  std::int64_t last_change_ = 0;
};

}  // namespace isoshift
