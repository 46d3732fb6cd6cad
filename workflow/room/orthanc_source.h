#pragma once
// An Orthanc server. Its objects are fetched as they arrive there, and kept in a folder until no object of their
// patient has arrived for a long time.

#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>

#include "base/backoff.h"
#include "io/network/orthanc.h"
#include "workflow/room/patient_files.h"

namespace isoshift {

class OrthancSource : public Source {
 public:
  // `server` is at `url`. Continues with the objects that an earlier run left in the folder `objects`.
  OrthancSource(const Orthanc& server, std::string url, std::filesystem::path objects, const Clock& clock);

  // Throws ServerError if the server does not answer.
  void update(Notes& notes) override;
  const std::map<std::string, Patient>& patients() const override { return files_.patients(); }
  std::vector<std::string> unreadable() const override { return {}; }  // the server stores only what it could read
  // True while the server has changes that were not read yet. An instance that the server fails to deliver counts for
  // every patient, for a minute, since its patient is not known.
  bool is_coming(const std::string& patient_id) const override;
  // The next update asks the server once which other objects it has of a patient, and again after each new object.
  void ask_for_rest(const std::string& patient_id) override { rest_.emplace(patient_id, Clock::Time()); }
  void forget_before(std::filesystem::file_time_type time, const std::set<std::string>& but) override;

 private:
  struct Attempts {
    int count = 0;
    Clock::Time since;
    Backoff again{std::chrono::seconds(1), std::chrono::minutes(10)};
  };
  void read_objects(Notes& notes);
  void check_server(Notes& notes);
  void compare_with_list();
  void fetch(const std::string& instance, Notes& notes);
  void put_off(const std::string& instance, const Error& error, Notes& notes);
  void find_rest(const std::string& patient_id, Notes& notes);
  void save_state();
  // Returns false if the file cannot be read.
  bool keep(const std::filesystem::path& object, Notes& notes);
  std::filesystem::path object_of(const std::string& instance) const;

  const Orthanc& server_;
  std::string url_;
  std::filesystem::path objects_;
  const Clock& clock_;
  PatientFiles files_;
  std::int64_t last_change_ = 0;
  std::string last_mark_;
  std::map<std::string, Attempts> unfetched_;  // instances
  std::map<std::string, Clock::Time> rest_;    // patients whose other objects are asked for, and when
  std::set<std::string> useless_;              // instances that belong to no study
  bool has_all_changes_ = true, has_read_objects_ = false, has_checked_server_ = false;
  bool is_listed_ = false;  // all instances that the server held were compared with those that are kept
  std::string saved_state_;
};

}  // namespace isoshift
