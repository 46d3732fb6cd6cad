#pragma once
// Compressed pixels in, checked pixels out: the one function that runs DCMTK's decoders.

#include <cstdint>
#include <vector>

#include "io/dicom_dataset.h"

namespace isoshift {

// Image Pixel module (PS3.3 C.7.6.3) of a single-frame grayscale image.
struct PixelFormat {
  int columns = 0;
  int rows = 0;
  int bits_stored = 16;
  bool is_signed = false;

  std::int32_t max_stored_value() const { return (1 << (is_signed ? bits_stored - 1 : bits_stored)) - 1; }
};

// Reads and checks the format: 8 or 16 bits allocated, one sample, HighBit = BitsStored - 1, at most 8192 x 8192.
PixelFormat pixel_format(const DicomItem& dataset);

// Stored values, row-major: masked to BitsStored and sign-extended, before any rescale. Decompresses in place: RLE,
// JPEG baseline and lossless, JPEG-LS. Throws Error naming the transfer syntax and the way around for any other.
std::vector<std::int32_t> decode_pixels(DicomFile& file, const PixelFormat& format);

}  // namespace isoshift
