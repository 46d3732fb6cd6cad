#pragma once
// The files of a treatment room to try: site, watch and serve files, two Orthanc servers, certificates and keys.

#include <filesystem>
#include <string>

namespace isoshift {

// Writes working files, which only this user can read, into a new folder. `user`: signs in on the screen. Throws Error
// if the folder exists or cannot be written.
void write_example_room(const std::filesystem::path& folder, const std::string& user);

}  // namespace isoshift
