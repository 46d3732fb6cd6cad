#pragma once
// JPEG 2000 (ISO/IEC 15444-1; PS3.5 8.2.4, A.4.4), which DCMTK does not decode: OpenJPEG does.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "io/dicom/decode.h"

namespace isoshift {

// The stored values of one frame as bytes, those of 16-bit pixels in the order of this machine, from its code stream.
// Throws Error beginning with `where` if the stream is damaged or cut off, or tiles are missing; if its size or sign is
// not the header's; if it holds several components or a part of the image; or if a value needs more than BitsStored.
// Only for the child process (decoder_process.h).
std::vector<std::uint8_t> decoded_jpeg2000(std::span<const std::uint8_t> stream, const PixelFormat& format,
                                           const std::string& where);

}  // namespace isoshift
