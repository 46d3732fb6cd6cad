#pragma once
// An Orthanc server: the instances that it has received, and their files. RestOrthanc asks a server by HTTP; tests have
// an Orthanc of their own.

#include <cstdint>
#include <string>
#include <vector>

#include "base/error.h"
#include "io/config/watch_file.h"

namespace isoshift {

// The server gave no answer, or its answer was cut off.
class ServerError : public Error {
 public:
  using Error::Error;
};

class Orthanc {
 public:
  virtual ~Orthanc() = default;

  struct Changes {
    std::vector<std::string> instances;  // Orthanc's identifiers of the new instances
    std::string mark;                    // of the last change: another database has another mark; empty: no change
    std::int64_t last = 0;               // the change from which to ask next time
    bool done = true;                    // there are no more changes for now
  };
  // The functions throw ServerError if the server does not answer, and Error if it refuses or answers something else.
  // The messages name the server.
  virtual Changes changes_since(std::int64_t last, int limit) const = 0;

  // The file of an instance, as the server received it; empty if the instance has been deleted since.
  virtual std::string file_of(const std::string& instance) const = 0;

  // All that the server holds.
  virtual std::vector<std::string> instances() const = 0;

  // All instances of the patient to whom this instance belongs; none if the instance has been deleted since.
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
  std::vector<std::string> instances() const override;
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
