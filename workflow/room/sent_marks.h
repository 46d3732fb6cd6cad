#pragma once
// The marks of what peers have confirmed: files NAME.PEER.FILE in a folder.

#include <filesystem>
#include <utility>

#include "workflow/room/release.h"

namespace isoshift {

class SentMarks {
 public:
  explicit SentMarks(std::filesystem::path folder) : folder_(std::move(folder)) {}

  // Writes the mark, which put() then only renames: if the disk is full, the object is not sent, since it could not be
  // marked.
  void prepare(const Delivery& delivery) const;
  bool is_prepared(const Delivery& delivery) const;
  void put(const Delivery& delivery) const;
  // A mark counts for the object that it names.
  bool has(const Delivery& delivery) const;

 private:
  std::filesystem::path file(const Delivery& delivery) const;
  std::filesystem::path prepared_file(const Delivery& delivery) const;

  std::filesystem::path folder_;
};

}  // namespace isoshift
