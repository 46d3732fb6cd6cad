#pragma once
// Pixel data in, checked pixels out. Compressed pixels are decoded by a child process (decoder_process.h).

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "io/dicom/dicom_dataset.h"

namespace isoshift {

// Image Pixel module (PS3.3 C.7.6.3) of a grayscale image of one or more frames.
struct PixelFormat {
  int columns = 0;
  int rows = 0;
  int frames = 1;
  int bits_allocated = 16;
  int bits_stored = 16;
  bool is_signed = false;

  std::int32_t max_stored_value() const { return (1 << (is_signed ? bits_stored - 1 : bits_stored)) - 1; }
  std::size_t pixels_per_frame() const { return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows); }
  std::size_t bytes_per_frame() const { return pixels_per_frame() * static_cast<std::size_t>(bits_allocated / 8); }
};

// Throws Error beginning with `where` if compressed pixels, columns and rows of them, have another size than the
// format.
void expect_size(const PixelFormat& format, std::pair<std::int64_t, std::int64_t> size, const std::string& where);

// Reads and checks the format: 8 or 16 bits allocated, one sample, HighBit = BitsStored - 1, at most 8192 x 8192 pixels
// and 20000 frames.
PixelFormat pixel_format(const DicomItem& dataset);

// The Image Pixel module of an image that is written: grayscale, 16 bits allocated, one frame.
void put_pixel_format(DicomItem dataset, const PixelFormat& format);

// Stored values of one frame (from 0), row-major: masked to BitsStored and sign-extended, before any rescale.
// Decompresses RLE, JPEG baseline and lossless, JPEG-LS and JPEG 2000. Throws Error naming the transfer syntax and the
// way around for any other, and for pixel data that are damaged or not as long as the format says.
std::vector<std::int32_t> decode_frame(const DicomFile& file, const PixelFormat& format, int frame);

// Reads DCMTK's dictionary and registers its decoders, which it keeps in a list of the process: once, and before the
// process is confined.
void prepare_decoding();

// One compressed frame as bytes, those of 16-bit pixels in the order of this machine: the decoders of DCMTK and
// OpenJPEG, run here. Only for the child process and for tests of hostile files.
std::vector<std::uint8_t> decompressed_frame(const DicomFile& file, int frame);

}  // namespace isoshift
