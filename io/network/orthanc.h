#pragma once
// An Orthanc server: which instances have come, and their files. RestOrthanc asks by HTTP; tests answer by themselves.

#include <cstdint>
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
  virtual ~Orthanc() = default;

  struct Changes {
    std::vector<std::string> instances;  // Orthanc's identifiers of those that are new
    std::string mark;                    // tells the last change from that of another database; empty: no change
    std::int64_t last = 0;               // to ask from next time
    bool done = true;                    // no more for now
  };
  // All three throw ServerError for a server that does not answer, Error for one that refuses or answers something
  // else; both name it.
  virtual Changes changes_since(std::int64_t last, int limit) const = 0;

  // The file as it was received; empty for one that has been deleted since.
  virtual std::string file_of(const std::string& instance) const = 0;

  // All instances of the patient whose one of them is; none if it has been deleted since.
  virtual std::vector<std::string> instances_beside(const std::string& instance) const = 0;
};

class RestOrthanc : public Orthanc {
 public:
  explicit RestOrthanc(OrthancServer server);
  ~RestOrthanc() override;
  RestOrthanc(const RestOrthanc&) = delete;
  RestOrthanc& operator=(const RestOrthanc&) = delete;

  Changes changes_since(std::int64_t last, int limit) const override;
  std::string file_of(const std::string& instance) const override;
  std::vector<std::string> instances_beside(const std::string& instance) const override;

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
