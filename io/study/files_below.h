#pragma once
// The files below folders, and what cannot be searched for them: links and folders that may not be opened.

#include <filesystem>
#include <set>
#include <string>
#include <unordered_set>
#include <vector>

namespace isoshift {

// All files below `paths` (files or folders), in the order of their names, without the files named in `but` and without
// hidden files (with a leading dot). Links below the paths are not followed: they may lead out of the study, or round
// and round. Throws Error for a path that does not exist or cannot be searched, and for a link to nothing. If
// `unsearchable` is given, such folders and links, and all other links, are skipped and added to it.
std::vector<std::filesystem::path> files_below(const std::vector<std::filesystem::path>& paths,
                                               const std::unordered_set<std::string>& but = {},
                                               std::set<std::filesystem::path>* unsearchable = nullptr);

// Whether what files_below() did not search is a link to something that is there.
bool is_link_to_something(const std::filesystem::path& unsearchable);
// "PATH: why it was not searched".
std::string why_not_searched(const std::filesystem::path& unsearchable);

}  // namespace isoshift
