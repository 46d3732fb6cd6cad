#include "io/dicom/decode.h"

#include <dcmtk/dcmdata/dccodec.h>
#include <dcmtk/dcmdata/dcpixseq.h>
#include <dcmtk/dcmdata/dcpxitem.h>
#include <dcmtk/dcmdata/dcrledrg.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djdecode.h>
#include <dcmtk/dcmjpls/djdecode.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <span>
#include <utility>

#include "base/error.h"
#include "io/dicom/decoder_process.h"
#include "io/dicom/file_structure.h"
#include "io/dicom/jpeg2000.h"

namespace isoshift {
namespace {

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

// The size that a JPEG stream itself gives, from its frame header (ITU-T T.81, B.2.2): columns and rows; nothing where
// there is none. DCMTK's decoder takes its word and lets the header's Rows and Columns fall out of step.
std::optional<std::pair<int, int>> jpeg_size(std::span<const Uint8> stream) {
  for (std::size_t at = 2; at + 9 <= stream.size() && stream[at] == 0xFF;) {
    const int marker = stream[at + 1];
    const bool is_frame_header =
        (marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC) || marker == 0xF7;
    if (is_frame_header) return std::pair(stream[at + 7] << 8 | stream[at + 8], stream[at + 5] << 8 | stream[at + 6]);
    at += 2 + static_cast<std::size_t>(stream[at + 2] << 8 | stream[at + 3]);
  }
  return std::nullopt;
}

bool is_jpeg2000(E_TransferSyntax syntax) { return syntax == EXS_JPEG2000LosslessOnly || syntax == EXS_JPEG2000; }

// The compressed pixels: an offset table, then the fragments of all frames (PS3.5 A.4); null where there are none.
DcmPixelSequence* fragments_of(DcmPixelData& pixels, const DcmDataset& dataset) {
  DcmPixelSequence* fragments = nullptr;
  const bool is_found = pixels.getEncapsulatedRepresentation(dataset.getOriginalXfer(), nullptr, fragments).good();
  return is_found ? fragments : nullptr;
}

// The compressed bytes of one frame, put together from their fragments (PS3.5 A.4); empty where they cannot be told
// from those of other frames.
std::vector<Uint8> frame_stream(DcmPixelSequence* fragments, int frame, int frames) {
  Uint32 index = 0, end = 0;
  if (fragments == nullptr ||
      DcmCodec::determineStartFragment(static_cast<Uint32>(frame), frames, fragments, index).bad())
    return {};
  end = static_cast<Uint32>(fragments->card());
  if (frame + 1 < frames &&
      DcmCodec::determineStartFragment(static_cast<Uint32>(frame) + 1, frames, fragments, end).bad())
    return {};
  std::vector<Uint8> stream;
  for (; index < end; ++index) {
    DcmPixelItem* fragment = nullptr;
    Uint8* bytes = nullptr;
    if (fragments->getItem(fragment, index).bad() || fragment->getUint8Array(bytes).bad() || bytes == nullptr)
      return {};
    stream.insert(stream.end(), bytes, bytes + fragment->getLength());
  }
  return stream;
}

// A frame in RLE is one fragment (PS3.5 A.4.2).
void expect_rle_frames(DcmPixelSequence* fragments, const PixelFormat& format, const std::string& where) {
  const unsigned long found = fragments == nullptr || fragments->card() == 0 ? 0 : fragments->card() - 1;
  if (found != static_cast<unsigned long>(format.frames))
    throw Error(fmt::format("{}: {} holds {} frames in RLE, expected {}", where, described(DCM_PixelData), found,
                            format.frames));
}

// The header of a frame in RLE: how many segments there are, one for each byte of a pixel, and where they begin (PS3.5
// G.5). DCMTK 3.6.7 reads whatever lies where the header says.
void expect_rle_header(std::span<const Uint8> stream, const PixelFormat& format, const std::string& where) {
  constexpr std::size_t kHeaderWords = 16;
  std::array<std::uint32_t, kHeaderWords> header{};
  bool is_sound = stream.size() > sizeof header;
  if (is_sound) {
    std::memcpy(header.data(), stream.data(), sizeof header);
    const auto segments = static_cast<std::size_t>(format.bits_allocated / 8);
    const std::span begins = std::span(header).subspan(1, segments);
    is_sound = header[0] == segments && begins.front() == sizeof header && std::ranges::is_sorted(begins) &&
               begins.back() < stream.size();
  }
  if (!is_sound)
    throw Error(fmt::format("{}: the header of a frame in RLE is damaged: expected {} segments, from byte {} on", where,
                            format.bits_allocated / 8, sizeof header));
}

}  // namespace

void expect_size(const PixelFormat& format, std::pair<std::int64_t, std::int64_t> size, const std::string& where) {
  if (size.first != format.columns || size.second != format.rows)
    throw Error(fmt::format("{}: its compressed pixels are {} x {}, {} and {} say {} x {}", where, size.first,
                            size.second, described(DCM_Columns), described(DCM_Rows), format.columns, format.rows));
}

PixelFormat pixel_format(const DicomItem& dataset) {
  PixelFormat format;
  format.columns = whole_number(dataset, DCM_Columns, kMaxEdge);
  format.rows = whole_number(dataset, DCM_Rows, kMaxEdge);
  if (dataset.has_value(DCM_NumberOfFrames)) format.frames = whole_number(dataset, DCM_NumberOfFrames, kMaxFrames);
  expect(dataset, DCM_SamplesPerPixel, 1);
  // Of a palette the stored values are numbers of colors.
  const std::string photometric = dataset.text(DCM_PhotometricInterpretation).value_or("MONOCHROME2");
  if (photometric != "MONOCHROME2" && photometric != "MONOCHROME1")
    throw Error(fmt::format("{}: {} is {}, expected MONOCHROME2", dataset.where(),
                            described(DCM_PhotometricInterpretation), photometric));
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
  const double representation = dataset.required_number(DCM_PixelRepresentation);
  if (representation != 0 && representation != 1)
    throw Error(fmt::format("{}: {} is {}, expected 0 (unsigned) or 1 (signed)", dataset.where(),
                            described(DCM_PixelRepresentation), representation));
  format.is_signed = representation == 1;
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
  if (file.is_compressed()) {
    decompressed = frame_from_decoder(file, frame, format.bytes_per_frame());
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

void prepare_decoding() {
  struct Decoders {
    Decoders() {
      (void)described(DCM_PixelData);  // DCMTK reads its dictionary from a file
      const DicomFile configures_dcmtk;
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

std::vector<std::uint8_t> decompressed_frame(const DicomFile& file, int frame) {
  prepare_decoding();
  const std::string where = file.path().string();
  const PixelFormat format = pixel_format(file.dataset());
  const std::size_t size = format.bytes_per_frame();
  auto& dataset = dynamic_cast<DcmDataset&>(file.dataset().dcmtk());
  DcmElement* element = nullptr;
  if (dataset.findAndGetElement(DCM_PixelData, element).bad() || dynamic_cast<DcmPixelData*>(element) == nullptr)
    throw Error(fmt::format("{}: {} is missing", where, described(DCM_PixelData)));
  auto& pixels = dynamic_cast<DcmPixelData&>(*element);
  const E_TransferSyntax syntax = dataset.getOriginalXfer();
  DcmPixelSequence* fragments = fragments_of(pixels, dataset);
  if (syntax == EXS_RLELossless) expect_rle_frames(fragments, format, where);
  const std::vector<Uint8> stream = frame_stream(fragments, frame, format.frames);
  if (is_jpeg2000(syntax)) return decoded_jpeg2000(stream, format, where);
  if (syntax == EXS_RLELossless)
    expect_rle_header(stream, format, where);
  else if (const auto announced = jpeg_size(stream))
    expect_size(format, *announced, where);
  Uint32 fragment = 0;  // found by the decoder
  OFString color_model;
  std::vector<std::uint8_t> bytes(size + size % 2);  // what DCMTK asks for, too: pixel_format() allows one sample only
  if (pixels
          .getUncompressedFrame(&dataset, static_cast<Uint32>(frame), fragment, bytes.data(),
                                static_cast<Uint32>(bytes.size()), color_model)
          .bad())
    throw Error(fmt::format("{}: pixel data in transfer syntax {} cannot be decoded.\n       {}", where,
                            DcmXfer(syntax).getXferName(), kConvertFirst));
  bytes.resize(size);
  return bytes;
}

}  // namespace isoshift
