#pragma once
// How deep the sequences of a DICOM file are nested, found without following them.

#include <filesystem>
#include <string_view>

namespace isoshift {

// Of the bytes of a file. Throws Error where sequences are nested more than 500 deep, or a deflated dataset (PS3.5 A.5)
// is larger than 1 GiB. DCMTK follows sequences by calling itself: a file that nests them without end would end the
// program.
void check_nesting(std::string_view bytes, const std::filesystem::path& path);

}  // namespace isoshift
