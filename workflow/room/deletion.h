#pragma once
// What remains of results that were deleted: deleted/NAME.json in a results tree, by which their X-rays are known, so
// that they are not registered again. It holds no name of a patient and no UID.

#include <filesystem>
#include <set>
#include <string>
#include <vector>

namespace isoshift {

struct Deletion {
  std::string session;          // the first of the X-rays' sessions
  std::string by, user;         // the person, or the rule of the watch file; and the user of the system
  std::string on;               // local time
  std::set<std::string> xrays;  // SHA-256 of their SOPInstanceUIDs
};

void put_deletion(const std::filesystem::path& results, const Deletion& deletion);
// Throws Error for a file that put_deletion() did not write.
std::vector<Deletion> deletions(const std::filesystem::path& results);
bool is_deleted(const std::filesystem::path& results, const std::string& session);

// Removes all that is kept of the results of X-rays that were deleted, but the audit log.
void remove_deleted(const std::filesystem::path& results, const std::vector<Deletion>& deleted);

}  // namespace isoshift
