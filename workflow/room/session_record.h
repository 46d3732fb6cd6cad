#pragma once
// The record of a registered session: which files its folder held when isoshift room watch registered it.

#include <filesystem>
#include <map>
#include <set>
#include <string>

namespace isoshift {

using FileHashes = std::map<std::string, std::string>;  // SHA-256 by name, of all files of a folder

struct SessionRecord {
  std::string session, verdict, on;  // `on`: local time
  std::string pose_set_by;           // who has set the pose by hand, without a search; empty: nobody
  FileHashes files;                  // including result.json
  std::string sha256;                // of the record's own file; empty until it is written
};

// The name of the N-th result of the same X-rays: "NAME" of the first, "NAME-2" of the second. `session`: the name of
// any of them.
std::string name_of_xrays(const std::string& session, int number = 1);

// The SOPInstanceUIDs of the X-rays of a result. Throws Error for a folder that holds none.
std::set<std::string> xrays_of(const std::filesystem::path& folder);

// The record of a folder that isoshift register has written. `made`: the files as it has written them. Throws Error if
// the folder holds anything else, or if the name of the session does not belong to the X-rays of the result.
SessionRecord record_of(const std::string& session, const std::filesystem::path& folder, const FileHashes& made);

// The record as a JSON file.
std::string json_of(const SessionRecord& record);
// Reads a record. Throws Error naming the file and what is wrong with it.
SessionRecord read_session_record(const std::filesystem::path& path);

// Throws Error naming a file of the folder that is missing, has been added or differs from what was registered.
void check_unchanged(const SessionRecord& record, const std::filesystem::path& folder);

}  // namespace isoshift
