#include "io/dicom/nesting.h"

#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace isoshift {
namespace {

constexpr std::size_t kMaxDepth = 500;  // no object nests more than ten deep
constexpr std::size_t kMaxInflatedBytes = std::size_t{1} << 30;

// The tags of an item and of what closes items and sequences of undefined length, as they stand in a file.
struct Delimiters {
  std::string_view item, item_end, sequence_end;
  bool is_little_endian;
};

constexpr Delimiters kLittleEndian{.item = {"\xFE\xFF\x00\xE0", 4},
                                   .item_end = {"\xFE\xFF\x0D\xE0", 4},
                                   .sequence_end = {"\xFE\xFF\xDD\xE0", 4},
                                   .is_little_endian = true};
constexpr Delimiters kBigEndian{.item = {"\xFF\xFE\xE0\x00", 4},
                                .item_end = {"\xFF\xFE\xE0\x0D", 4},
                                .sequence_end = {"\xFF\xFE\xE0\xDD", 4},
                                .is_little_endian = false};

// Items are found by their tags, wherever they stand. They close at their length's end or by a tag of their own; a
// sequence of undefined length, known by the length before its first item, by a tag alone: DCMTK lets one run on behind
// the end of the item around it.
bool is_too_deep(std::string_view bytes, const Delimiters& tags) {
  constexpr std::size_t kUntilClosed = std::string_view::npos;
  std::vector<std::size_t> ends;  // of the items and sequences that are open
  const std::string_view group = tags.item.substr(0, 2);
  for (std::size_t at = bytes.find(group); at != std::string_view::npos && at + 8 <= bytes.size();
       at = bytes.find(group, at + 1)) {
    const std::string_view tag = bytes.substr(at, 4);
    while (!ends.empty() && ends.back() != kUntilClosed && ends.back() <= at) ends.pop_back();
    if ((tag == tags.item_end || tag == tags.sequence_end) && !ends.empty() && ends.back() == kUntilClosed)
      ends.pop_back();
    if (tag != tags.item) continue;
    if (at >= 4 && bytes.substr(at - 4, 4) == "\xFF\xFF\xFF\xFF") ends.push_back(kUntilClosed);
    std::uint32_t length = 0;
    for (std::size_t n = 0; n < 4; ++n)
      length |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[at + 4 + n]))
                << 8 * (tags.is_little_endian ? n : 3 - n);
    ends.push_back(length == 0xFFFFFFFF ? kUntilClosed : at + 8 + length);
    if (ends.size() > kMaxDepth) return true;
  }
  return false;
}

void check_depth(std::string_view bytes, const std::filesystem::path& path) {
  if (is_too_deep(bytes, kLittleEndian) || is_too_deep(bytes, kBigEndian))
    throw Error(fmt::format("{}: its sequences are nested more than {} deep", path.string(), kMaxDepth));
}

// What follows the file meta information, inflated; empty where it is not deflated or DCMTK cannot read it either.
std::string inflated_dataset(std::string_view file, const std::filesystem::path& path) {
  DcmInputBufferStream stream;
  stream.setBuffer(file.data(), static_cast<offile_off_t>(file.size()));
  stream.setEos();
  DcmMetaInfo meta;
  meta.transferInit();
  const bool is_read = meta.read(stream).good();
  meta.transferEnd();
  OFString transfer_syntax;
  if (!is_read || meta.findAndGetOFString(DCM_TransferSyntaxUID, transfer_syntax).bad()) return {};
  const E_StreamCompression compression = DcmXfer(transfer_syntax.c_str()).getStreamCompression();
  if (compression == ESC_none || stream.installCompressionFilter(compression).bad()) return {};

  std::string bytes;
  std::vector<char> block(std::size_t{1} << 20);
  while (const auto size = stream.read(block.data(), static_cast<offile_off_t>(block.size()))) {
    bytes.append(block.data(), static_cast<std::size_t>(size));
    if (bytes.size() > kMaxInflatedBytes)
      throw Error(fmt::format("{}: its dataset inflates to more than {} bytes", path.string(), kMaxInflatedBytes));
  }
  return bytes;
}

}  // namespace

void check_nesting(std::string_view bytes, const std::filesystem::path& path) {
  check_depth(bytes, path);
  check_depth(inflated_dataset(bytes, path), path);
}

}  // namespace isoshift
