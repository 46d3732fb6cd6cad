#include "io/decode.h"

#include <dcmtk/dcmdata/dcrledrg.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djdecode.h>
#include <dcmtk/dcmjpls/djdecode.h>
#include <fmt/format.h>

#include <cstring>

#include "geometry/error.h"
#include "io/decoder_process.h"

namespace isoshift {
namespace {

constexpr int kMaxEdge = 8192;
constexpr int kMaxFrames = 20000;

// DCMTK keeps its decoders in a global list: registered once, before any thread decodes, and removed at exit.
void register_decoders() {
  struct Decoders {
    Decoders() {
      DcmRLEDecoderRegistration::registerCodecs();
      DJDecoderRegistration::registerCodecs();
      DJLSDecoderRegistration::registerCodecs();
    }
    ~Decoders() {
      DJLSDecoderRegistration::cleanup();
      DJDecoderRegistration::cleanup();
      DcmRLEDecoderRegistration::cleanup();
    }
  };
  static const Decoders decoders;
}

int whole_number(const DicomItem& dataset, const DcmTagKey& tag, int max) {
  const double value = dataset.required_number(tag);
  if (!(value >= 1 && value <= max))
    throw Error(fmt::format("{}: {} is {}, expected 1 to {}", dataset.where(), described(tag), value, max));
  return static_cast<int>(value);
}

void expect(const DicomItem& dataset, const DcmTagKey& tag, double expected) {
  const double found = dataset.required_number(tag);
  if (found != expected)
    throw Error(fmt::format("{}: {} is {}, expected {}", dataset.where(), described(tag), found, expected));
}

// The bytes of a frame that lies in the file as it is. 16-bit pixels come as words; 8-bit pixels as bytes or, in
// implicit VR, as words of two.
std::span<const std::uint8_t> native_frame(DcmItem& dataset, const PixelFormat& format, int frame,
                                           const std::string& where) {
  const Uint8* bytes = nullptr;
  const Uint16* words = nullptr;
  unsigned long available = 0;
  if (format.bits_allocated == 8 && dataset.findAndGetUint8Array(DCM_PixelData, bytes, &available).good() &&
      bytes != nullptr) {
  } else if (dataset.findAndGetUint16Array(DCM_PixelData, words, &available).good() && words != nullptr) {
    bytes = reinterpret_cast<const Uint8*>(words);
    available *= 2;
  } else {
    throw Error(fmt::format("{}: {} is missing", where, described(DCM_PixelData)));
  }
  const std::size_t pixels = available / static_cast<std::size_t>(format.bits_allocated / 8);
  if (pixels < format.pixels_per_frame() * static_cast<std::size_t>(format.frames))
    throw Error(fmt::format("{}: {} holds {} pixels, expected {} x {}{}", where, described(DCM_PixelData), pixels,
                            format.columns, format.rows,
                            format.frames > 1 ? fmt::format(" in {} frames", format.frames) : ""));
  return {bytes + static_cast<std::size_t>(frame) * format.bytes_per_frame(), format.bytes_per_frame()};
}

}  // namespace

PixelFormat pixel_format(const DicomItem& dataset) {
  PixelFormat format;
  format.columns = whole_number(dataset, DCM_Columns, kMaxEdge);
  format.rows = whole_number(dataset, DCM_Rows, kMaxEdge);
  if (dataset.has_value(DCM_NumberOfFrames)) format.frames = whole_number(dataset, DCM_NumberOfFrames, kMaxFrames);
  expect(dataset, DCM_SamplesPerPixel, 1);
  const double allocated = dataset.required_number(DCM_BitsAllocated);
  if (allocated != 8 && allocated != 16)
    throw Error(
        fmt::format("{}: {} is {}, expected 8 or 16", dataset.where(), described(DCM_BitsAllocated), allocated));
  const double stored = dataset.required_number(DCM_BitsStored);
  if (stored < 8 || stored > allocated)
    throw Error(
        fmt::format("{}: {} is {}, expected 8 to {}", dataset.where(), described(DCM_BitsStored), stored, allocated));
  format.bits_allocated = static_cast<int>(allocated);
  format.bits_stored = static_cast<int>(stored);
  expect(dataset, DCM_HighBit, stored - 1);
  format.is_signed = dataset.required_number(DCM_PixelRepresentation) != 0;
  return format;
}

void put_pixel_format(DicomItem dataset, const PixelFormat& format) {
  dataset.put(DCM_SamplesPerPixel, 1);
  dataset.put(DCM_PhotometricInterpretation, "MONOCHROME2");
  dataset.put(DCM_Rows, format.rows);
  dataset.put(DCM_Columns, format.columns);
  dataset.put(DCM_BitsAllocated, format.bits_allocated);
  dataset.put(DCM_BitsStored, format.bits_stored);
  dataset.put(DCM_HighBit, format.bits_stored - 1);
  dataset.put(DCM_PixelRepresentation, format.is_signed ? 1 : 0);
}

std::vector<std::int32_t> decode_frame(const DicomFile& file, const PixelFormat& format, int frame) {
  auto& dataset = dynamic_cast<DcmDataset&>(file.dataset().dcmtk());
  std::vector<std::uint8_t> decompressed;
  std::span<const std::uint8_t> bytes;
  if (DcmXfer(dataset.getOriginalXfer()).isEncapsulated()) {
    decompressed = frame_from_decoder(file.path(), frame, format.bytes_per_frame());
    bytes = decompressed;
  } else {
    bytes = native_frame(dataset, format, frame, file.path().string());
  }

  const auto mask = static_cast<std::uint32_t>((1U << format.bits_stored) - 1);
  const auto sign = format.is_signed ? std::uint32_t{1} << (format.bits_stored - 1) : 0;
  std::vector<std::int32_t> stored_values(format.pixels_per_frame());
  for (std::size_t n = 0; n < stored_values.size(); ++n) {
    std::uint32_t raw = bytes[n];
    if (format.bits_allocated == 16) {
      std::uint16_t word = 0;
      std::memcpy(&word, bytes.data() + 2 * n, sizeof word);
      raw = word;
    }
    stored_values[n] = static_cast<std::int32_t>((raw & mask) ^ sign) - static_cast<std::int32_t>(sign);
  }
  return stored_values;
}

std::vector<std::uint8_t> decompressed_frame(const std::filesystem::path& path, int frame) {
  register_decoders();
  const DicomFile file = DicomFile::read(path, DicomFile::Extent::kWhole);
  const std::size_t size = pixel_format(file.dataset()).bytes_per_frame();
  auto& dataset = dynamic_cast<DcmDataset&>(file.dataset().dcmtk());
  DcmElement* element = nullptr;
  if (dataset.findAndGetElement(DCM_PixelData, element).bad() || dynamic_cast<DcmPixelData*>(element) == nullptr)
    throw Error(fmt::format("{}: {} is missing", path.string(), described(DCM_PixelData)));
  auto& pixels = dynamic_cast<DcmPixelData&>(*element);
  Uint32 frame_size = 0;
  Uint32 fragment = 0;  // found by the decoder
  OFString color_model;
  std::vector<std::uint8_t> bytes(size + size % 2);
  if (pixels.getUncompressedFrameSize(&dataset, frame_size).bad() || frame_size > bytes.size() ||
      pixels
          .getUncompressedFrame(&dataset, static_cast<Uint32>(frame), fragment, bytes.data(),
                                static_cast<Uint32>(bytes.size()), color_model)
          .bad())
    throw Error(
        fmt::format("{}: pixel data in transfer syntax {} cannot be decoded.\n"
                    "       Convert the file first: gdcmconv --raw IN.dcm OUT.dcm (Debian package libgdcm-tools)",
                    path.string(), DcmXfer(dataset.getOriginalXfer()).getXferName()));
  bytes.resize(size);
  return bytes;
}

}  // namespace isoshift
