#include "io/nesting.h"

#include <dcmtk/dcmdata/dcistrmf.h>
#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>

#include <cstdint>
#include <fstream>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/error.h"

namespace isoshift {
namespace {

constexpr std::size_t kMaxDepth = 500;  // no object nests more than ten deep
constexpr std::size_t kMaxInflatedBytes = std::size_t{1} << 30;

// Items are found by their tags (FFFE,E000), wherever they stand, and close at their length's end or by (FFFE,E00D).
bool is_too_deep(std::string_view bytes, std::string_view item, std::string_view close, bool is_little_endian) {
  std::vector<std::size_t> ends;  // of the items that are open; npos: until it is closed
  for (std::size_t at = bytes.find(item.substr(0, 2)); at != std::string_view::npos && at + 8 <= bytes.size();
       at = bytes.find(item.substr(0, 2), at + 1)) {
    const std::string_view tag = bytes.substr(at, 4);
    while (!ends.empty() && ends.back() != std::string_view::npos && ends.back() <= at) ends.pop_back();
    if (tag == close && !ends.empty()) ends.pop_back();
    if (tag != item) continue;
    std::uint32_t length = 0;
    for (std::size_t n = 0; n < 4; ++n)
      length |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[at + 4 + n]))
                << 8 * (is_little_endian ? n : 3 - n);
    ends.push_back(length == 0xFFFFFFFF ? std::string_view::npos : at + 8 + length);
    if (ends.size() > kMaxDepth) return true;
  }
  return false;
}

void check_depth(std::string_view bytes, const std::filesystem::path& path) {
  if (is_too_deep(bytes, {"\xFE\xFF\x00\xE0", 4}, {"\xFE\xFF\x0D\xE0", 4}, true) ||
      is_too_deep(bytes, {"\xFF\xFE\xE0\x00", 4}, {"\xFF\xFE\xE0\x0D", 4}, false))
    throw Error(fmt::format("{}: its sequences are nested more than {} deep", path.string(), kMaxDepth));
}

// What follows the file meta information, inflated; empty where it is not deflated or DCMTK cannot read it either.
std::string inflated_dataset(const std::filesystem::path& path) {
  DcmInputFileStream stream(path.c_str());
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

void check_nesting(const std::filesystem::path& path) {
  std::ostringstream read;
  read << std::ifstream(path, std::ios::binary).rdbuf();
  check_depth(read.view(), path);
  check_depth(inflated_dataset(path), path);
}

}  // namespace isoshift
