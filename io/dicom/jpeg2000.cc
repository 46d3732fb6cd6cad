#include "io/dicom/jpeg2000.h"

#include <fmt/format.h>
#include <openjpeg.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <memory>

#include "base/error.h"

namespace isoshift {
namespace {

// What OpenJPEG reads from: bytes in memory.
struct Bytes {
  std::span<const std::uint8_t> all;
  std::size_t at = 0;
};

OPJ_SIZE_T read_bytes(void* to, OPJ_SIZE_T most, void* data) {
  auto& bytes = *static_cast<Bytes*>(data);
  const std::size_t count = std::min<std::size_t>(most, bytes.all.size() - bytes.at);
  if (count == 0) return static_cast<OPJ_SIZE_T>(-1);  // the end
  std::memcpy(to, bytes.all.data() + bytes.at, count);
  bytes.at += count;
  return count;
}

OPJ_OFF_T skip_bytes(OPJ_OFF_T count, void* data) {
  auto& bytes = *static_cast<Bytes*>(data);
  const auto left = static_cast<OPJ_OFF_T>(bytes.all.size() - bytes.at);
  if (count < 0 || left == 0) return -1;
  const OPJ_OFF_T skipped = std::min(count, left);
  bytes.at += static_cast<std::size_t>(skipped);
  return skipped;
}

OPJ_BOOL seek_bytes(OPJ_OFF_T to, void* data) {
  auto& bytes = *static_cast<Bytes*>(data);
  if (to < 0 || static_cast<std::size_t>(to) > bytes.all.size()) return OPJ_FALSE;
  bytes.at = static_cast<std::size_t>(to);
  return OPJ_TRUE;
}

// OpenJPEG's first complaint, which names the fault; those that follow come from it.
void keep_first(const char* message, void* data) {
  auto& first = *static_cast<std::string*>(data);
  if (!first.empty()) return;
  first = message;
  first.erase(first.find_last_not_of(" \r\n") + 1);
}

using OpjStream = std::unique_ptr<opj_stream_t, decltype(&opj_stream_destroy)>;
using OpjCodec = std::unique_ptr<opj_codec_t, decltype(&opj_destroy_codec)>;
using OpjImage = std::unique_ptr<opj_image_t, decltype(&opj_image_destroy)>;

OpjStream stream_from(Bytes& bytes) {
  OpjStream stream(opj_stream_default_create(OPJ_TRUE), &opj_stream_destroy);
  opj_stream_set_user_data(stream.get(), &bytes, nullptr);
  opj_stream_set_user_data_length(stream.get(), bytes.all.size());
  opj_stream_set_read_function(stream.get(), &read_bytes);
  opj_stream_set_skip_function(stream.get(), &skip_bytes);
  opj_stream_set_seek_function(stream.get(), &seek_bytes);
  return stream;
}

std::uint32_t number(std::span<const std::uint8_t> bytes) {
  std::uint32_t value = 0;
  for (const std::uint8_t byte : bytes) value = value << 8 | byte;
  return value;
}

// How many tile-parts of each tile are there (ISO/IEC 15444-1, A.4.2). Throws Error for a stream that ends within one,
// or whose tile-parts are out of order or less than they say: OpenJPEG takes what is missing for zeros.
std::map<std::uint32_t, std::uint32_t> tile_parts_in(std::span<const std::uint8_t> stream, const std::string& where) {
  constexpr std::uint32_t kStartOfTilePart = 0xFF90, kEnd = 0xFFD9;
  constexpr std::size_t kSegment = 12;  // marker, length, tile, length of the tile-part, its number, count of all
  const auto at = [&](std::size_t place, std::size_t count) {
    if (place > stream.size() || stream.size() - place < count)
      throw Error(fmt::format("{}: its JPEG 2000 pixels are cut off", where));
    return number(stream.subspan(place, count));
  };
  std::size_t place = 2;
  while (at(place, 2) != kStartOfTilePart && at(place, 2) != kEnd) place += 2 + at(place + 2, 2);
  std::map<std::uint32_t, std::uint32_t> counts, announced;
  while (at(place, 2) == kStartOfTilePart) {
    const std::uint32_t tile = at(place + 4, 2), length = at(place + 6, 4), part = at(place + 10, 1);
    if (part != counts[tile]++) throw Error(fmt::format("{}: its JPEG 2000 tile-parts are out of order", where));
    if (const std::uint32_t of = at(place + 11, 1); of != 0) announced[tile] = of;
    if (length == 0) break;  // up to the end
    if (length < kSegment) throw Error(fmt::format("{}: its JPEG 2000 tile-parts are damaged", where));
    place += length;
  }
  for (const auto& [tile, count] : announced)
    if (counts[tile] != count)
      throw Error(fmt::format("{}: of its JPEG 2000 tile {} there are {} tile-parts, expected {}", where, tile,
                              counts[tile], count));
  return counts;
}

void expect_all_tiles(opj_codec_t* codec, std::span<const std::uint8_t> stream, const std::string& where) {
  opj_codestream_info_v2_t* info = opj_get_cstr_info(codec);
  const std::size_t tiles = std::size_t{info->tw} * info->th;
  opj_destroy_cstr_info(&info);
  if (const std::size_t found = tile_parts_in(stream, where).size(); found != tiles)
    throw Error(fmt::format("{}: {} of its {} JPEG 2000 tiles are there", where, found, tiles));
}

// Before OpenJPEG looks into the stream, which reserves some 10 KB for each of its tiles: the image is that of the
// header, and the tiles are not many (ISO/IEC 15444-1, A.5.1). A stream without this segment OpenJPEG refuses itself.
void check_announced_size(std::span<const std::uint8_t> stream, const PixelFormat& format, const std::string& where) {
  constexpr std::uint32_t kSize = 0xFF51, kMostTiles = 4096;
  constexpr std::size_t kEndOfTileOffsets = 40;
  if (stream.size() < kEndOfTileOffsets || number(stream.subspan(2, 2)) != kSize) return;
  const auto word = [&](std::size_t n) -> std::int64_t { return number(stream.subspan(8 + 4 * n, 4)); };
  expect_size(format, {word(0) - word(2), word(1) - word(3)}, where);
  const auto tiles_along = [&](std::size_t axis) {
    const std::int64_t tile = std::max<std::int64_t>(word(4 + axis), 1);
    return (word(axis) - word(6 + axis) + tile - 1) / tile;
  };
  const std::int64_t across = tiles_along(0), down = tiles_along(1);
  if (std::max(across, down) > kMostTiles || across * down > kMostTiles)
    throw Error(fmt::format("{}: its JPEG 2000 pixels have more than {} tiles", where, kMostTiles));
}

// Before anything is decoded: what the stream announces is the image of the header.
void check_is_of(const PixelFormat& format, const opj_image_t& image, const std::string& where) {
  if (image.numcomps != 1)
    throw Error(fmt::format("{}: its compressed pixels have {} components, expected 1", where, image.numcomps));
  const opj_image_comp_t& pixels = image.comps[0];
  expect_size(format, {pixels.w, pixels.h}, where);
  if ((pixels.sgnd != 0) != format.is_signed)
    throw Error(fmt::format("{}: its compressed pixels are {}, {} says {}", where,
                            pixels.sgnd != 0 ? "signed" : "unsigned", described(DCM_PixelRepresentation),
                            format.is_signed ? "signed" : "unsigned"));
}

}  // namespace

std::vector<std::uint8_t> decoded_jpeg2000(std::span<const std::uint8_t> stream, const PixelFormat& format,
                                           const std::string& where) {
  std::string fault;
  const auto expect = [&](bool is_done) {
    if (!is_done)
      throw Error(fmt::format("{}: its JPEG 2000 pixels cannot be decoded: {}", where,
                              fault.empty() ? "they are damaged" : fault));
  };
  check_announced_size(stream, format, where);
  Bytes bytes{stream};
  const OpjStream source = stream_from(bytes);
  const OpjCodec codec(opj_create_decompress(OPJ_CODEC_J2K), &opj_destroy_codec);
  opj_set_error_handler(codec.get(), &keep_first, &fault);
  opj_dparameters_t parameters;
  opj_set_default_decoder_parameters(&parameters);
  expect(opj_setup_decoder(codec.get(), &parameters) && opj_decoder_set_strict_mode(codec.get(), OPJ_TRUE));
  opj_image_t* announced = nullptr;
  const bool is_read = opj_read_header(source.get(), codec.get(), &announced);
  const OpjImage image(announced, &opj_image_destroy);
  expect(is_read);
  check_is_of(format, *image, where);
  expect_all_tiles(codec.get(), stream, where);
  expect(opj_decode(codec.get(), source.get(), image.get()) && opj_end_decompress(codec.get(), source.get()) &&
         image->comps[0].data != nullptr);

  const std::span<const OPJ_INT32> values(image->comps[0].data, format.pixels_per_frame());
  const auto [least, greatest] = std::ranges::minmax(values);
  if (greatest > format.max_stored_value() || least < (format.is_signed ? -format.max_stored_value() - 1 : 0))
    throw Error(fmt::format("{}: its compressed pixels have values from {} to {}, more than the {} bits of {} hold",
                            where, least, greatest, format.bits_stored, described(DCM_BitsStored)));
  std::vector<std::uint8_t> pixels(format.bytes_per_frame());
  for (std::size_t n = 0; n < values.size(); ++n) {
    const auto word = static_cast<std::uint16_t>(values[n]);
    if (format.bits_allocated == 16)
      std::memcpy(pixels.data() + 2 * n, &word, sizeof word);
    else
      pixels[n] = static_cast<std::uint8_t>(word);
  }
  return pixels;
}

}  // namespace isoshift
