#pragma once
// What the elements of a DICOM file announce, followed without reading their values (PS3.5 7.1, 7.5; PS3.10 7.1).
// DCMTK believes every length, follows sequences by calling itself, and keeps some 200 bytes for each element: a file
// that is made to do harm would take all of the memory or of the stack.

#include <cstdint>

#include "io/dicom/file_bytes.h"

namespace isoshift {

// Of an image: what readers allow, and what bounds the bytes of its pixels.
inline constexpr int kMaxEdge = 8192, kMaxFrames = 20000;

// What messages say of a file that ends too early, and of pixels that nobody here decodes.
inline constexpr const char* kIsCutOff =
    "ends before what its elements announce: the file has been cut off, or is still being written";
inline constexpr const char* kConvertFirst =
    "Convert the file first: gdcmconv --raw IN.dcm OUT.dcm (Debian package libgdcm-tools)";

struct FileStructure {
  bool is_deflated = false;      // the dataset is compressed (PS3.5 A.5)
  std::uint64_t header_end = 0;  // where Pixel Data begins; the end of the file where there are none, or if deflated
};

// Throws Error naming the file, the place and what stands there, if an element ends behind the file or behind the item
// around it; if anything follows the dataset; if sequences are nested more than 500 deep; if there are more than 1.5
// million elements, or more than 100000 of them that have less than 16 bytes in the mean, or more than 128 MiB besides
// the pixels; if there are more pixels than the header announces; if a deflated dataset is larger than 64 MiB; or if
// the transfer syntax is not known.
FileStructure structure_of(FileBytes& file);

}  // namespace isoshift
