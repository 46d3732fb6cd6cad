#pragma once
// An Orthanc server, by its REST interface: which instances have come, and their files.

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "base/error.h"
#include "io/config/watch_file.h"

namespace isoshift {

// No answer, or one that was cut off.
class ServerError : public Error {
 public:
  using Error::Error;
};

class Orthanc {
 public:
  explicit Orthanc(OrthancServer server);
  ~Orthanc();
  Orthanc(const Orthanc&) = delete;
  Orthanc& operator=(const Orthanc&) = delete;

  struct Changes {
    std::vector<std::string> instances;  // Orthanc's identifiers of those that are new
    std::string mark;                    // tells the last change from that of another database; empty: no change
    std::int64_t last = 0;               // to ask from next time
    bool done = true;                    // no more for now
  };
  // Throws ServerError for one that does not answer, Error for one that refuses or answers something else; both name
  // it.
  Changes changes_since(std::int64_t last, int limit = 200) const;

  // The file as it was received; empty for one that has been deleted since.
  std::string file_of(const std::string& instance) const;

  // All instances of the patient whose one of them is; none if it has been deleted since.
  std::vector<std::string> instances_beside(const std::string& instance) const;

 private:
  struct Answer {
    long status = 0;
    std::string body;
  };
  Answer get(const std::string& path) const;

  OrthancServer server_;
  void* curl_;
};

}  // namespace isoshift
