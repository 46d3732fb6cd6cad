#pragma once
// The record of a registered session: which files its folder held when isoshift watch registered it.

#include <filesystem>
#include <map>
#include <string>

namespace isoshift {

struct SessionRecord {
  std::string session, verdict, on;          // `on`: local time
  std::map<std::string, std::string> files;  // SHA-256 by name, of all files of the folder, including result.json
  std::string sha256;                        // of the record's own file; empty until it is written
};

// The record of a folder that isoshift register has just written. Throws Error if the folder holds anything but plain
// files, or if the name of the session does not belong to the X-rays of the result.
SessionRecord record_of(const std::string& session, const std::filesystem::path& folder);

// The record as a JSON file.
std::string json_of(const SessionRecord& record);
// Reads a record. Throws Error naming the file and what is wrong with it.
SessionRecord read_session_record(const std::filesystem::path& path);

// Throws Error naming a file of the folder that is missing, has been added or differs from what was registered.
void check_unchanged(const SessionRecord& record, const std::filesystem::path& folder);

}  // namespace isoshift
