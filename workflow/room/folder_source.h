#pragma once
// A folder that other programs fill.

#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>

#include "workflow/room/patient_files.h"

namespace isoshift {

// A file is read once it has not changed between two updates. A file that is removed is forgotten.
class FolderSource : public Source {
 public:
  FolderSource(std::filesystem::path folder, const Clock& clock)
      : folder_(std::move(folder)), clock_(clock), files_(clock) {}

  void update(Notes& notes) override;
  const std::map<std::string, Patient>& patients() const override { return files_.patients(); }
  std::vector<std::string> unreadable() const override;
  // True while a file of this patient grows. A file whose patient is not known yet counts for every patient, for a
  // minute.
  bool is_coming(const std::string& patient_id) const override;
  void ask_for_rest(const std::string& /*patient_id*/) override {}  // the folder has no other files
  void forget_before(std::filesystem::file_time_type /*time*/, const std::set<std::string>& /*but*/) override {
  }  // the folder is not ours

 private:
  struct Version {
    std::uintmax_t size = 0;
    std::filesystem::file_time_type written;
    bool operator==(const Version&) const = default;
  };
  struct Growing {
    Version version;
    Clock::Time since;
    std::string patient_id;  // empty: unknown
  };
  Growing growing(const std::filesystem::path& file, const Version& version) const;
  void forget_missing(const std::vector<std::filesystem::path>& files);
  void look_at(const std::filesystem::path& file, std::map<std::filesystem::path, Growing>& still_growing,
               Notes& notes);
  void warn_once(const std::filesystem::path& unopened, Notes& notes);
  void read_again(const std::vector<std::filesystem::path>& copies);

  std::filesystem::path folder_;
  const Clock& clock_;
  PatientFiles files_;
  std::map<std::filesystem::path, Version> done_;
  std::map<std::filesystem::path, Growing> growing_;
  std::set<std::filesystem::path> unopened_;  // files and folders
};

}  // namespace isoshift
