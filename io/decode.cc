#include "io/decode.h"

#include <dcmtk/dcmdata/dcrledrg.h>
#include <dcmtk/dcmdata/dctk.h>
#include <dcmtk/dcmjpeg/djdecode.h>
#include <dcmtk/dcmjpls/djdecode.h>
#include <fmt/format.h>

#include "geometry/error.h"

namespace isoshift {
namespace {

constexpr int kMaxEdge = 8192;

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

int edge(const DicomItem& dataset, const DcmTagKey& tag) {
  const double value = dataset.required_number(tag);
  if (value < 1 || value > kMaxEdge)
    throw Error(fmt::format("{}: {} is {}, expected 1 to {}", dataset.where(), described(tag), value, kMaxEdge));
  return static_cast<int>(value);
}

void expect(const DicomItem& dataset, const DcmTagKey& tag, double expected) {
  const double found = dataset.required_number(tag);
  if (found != expected)
    throw Error(fmt::format("{}: {} is {}, expected {}", dataset.where(), described(tag), found, expected));
}

}  // namespace

PixelFormat pixel_format(const DicomItem& dataset) {
  PixelFormat format;
  format.columns = edge(dataset, DCM_Columns);
  format.rows = edge(dataset, DCM_Rows);
  expect(dataset, DCM_SamplesPerPixel, 1);
  const double allocated = dataset.required_number(DCM_BitsAllocated);
  if (allocated != 8 && allocated != 16)
    throw Error(
        fmt::format("{}: {} is {}, expected 8 or 16", dataset.where(), described(DCM_BitsAllocated), allocated));
  const double stored = dataset.required_number(DCM_BitsStored);
  if (stored < 8 || stored > allocated)
    throw Error(
        fmt::format("{}: {} is {}, expected 8 to {}", dataset.where(), described(DCM_BitsStored), stored, allocated));
  format.bits_stored = static_cast<int>(stored);
  expect(dataset, DCM_HighBit, stored - 1);
  format.is_signed = dataset.required_number(DCM_PixelRepresentation) != 0;
  if (const auto frames = dataset.number(DCM_NumberOfFrames); frames && *frames != 1)
    throw Error(fmt::format("{}: {} is {}; images of several frames are not read by this version", dataset.where(),
                            described(DCM_NumberOfFrames), *frames));
  return format;
}

std::vector<std::int32_t> decode_pixels(DicomFile& file, const PixelFormat& format) {
  register_decoders();
  const std::string where = file.path().string();
  auto& dataset = dynamic_cast<DcmDataset&>(file.dataset().dcmtk());
  const DcmXfer transfer_syntax(dataset.getOriginalXfer());
  if (dataset.chooseRepresentation(EXS_LittleEndianExplicit, nullptr).bad())
    throw Error(
        fmt::format("{}: pixel data in transfer syntax {} cannot be decoded.\n"
                    "       Convert the file first: gdcmconv --raw IN.dcm OUT.dcm (Debian package libgdcm-tools)",
                    where, transfer_syntax.getXferName()));

  const std::size_t count = static_cast<std::size_t>(format.columns) * format.rows;
  const auto mask = static_cast<std::uint32_t>((1U << format.bits_stored) - 1);
  const auto sign = format.is_signed ? std::uint32_t{1} << (format.bits_stored - 1) : 0;
  const auto from_raw = [&](std::uint32_t raw) {
    return static_cast<std::int32_t>((raw & mask) ^ sign) - static_cast<std::int32_t>(sign);
  };
  const auto check_length = [&](unsigned long available) {
    if (available < count)
      throw Error(fmt::format("{}: {} holds {} pixels, expected {} x {}", where, described(DCM_PixelData), available,
                              format.columns, format.rows));
  };

  // 16-bit pixels come as words; 8-bit pixels as bytes or, in implicit VR, as words of two.
  const bool wide = file.dataset().required_number(DCM_BitsAllocated) == 16;
  std::vector<std::int32_t> stored_values(count);
  unsigned long available = 0;
  const Uint8* bytes = nullptr;
  const Uint16* words = nullptr;
  if (!wide && dataset.findAndGetUint8Array(DCM_PixelData, bytes, &available).good() && bytes != nullptr) {
    check_length(available);
  } else if (dataset.findAndGetUint16Array(DCM_PixelData, words, &available).good() && words != nullptr) {
    check_length(wide ? available : 2 * available);
    bytes = reinterpret_cast<const Uint8*>(words);
  } else {
    throw Error(fmt::format("{}: {} is missing", where, described(DCM_PixelData)));
  }
  for (std::size_t n = 0; n < count; ++n) stored_values[n] = from_raw(wide ? words[n] : bytes[n]);
  return stored_values;
}

}  // namespace isoshift
