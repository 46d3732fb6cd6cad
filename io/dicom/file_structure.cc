#include "io/dicom/file_structure.h"

#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <new>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "io/dicom/dicom_dataset.h"

namespace isoshift {
namespace {

constexpr std::size_t kMaxDepth = 500;  // no object nests more than ten deep
// Structure sets of 150000 contours have 1.5 million elements, of 30 bytes and more in the mean.
constexpr std::size_t kMaxElements = 1'500'000, kElementsOfAnySize = 100'000, kLeastMeanBytes = 16;
constexpr std::uint64_t kMaxHeaderBytes = std::uint64_t{128} << 20;
constexpr std::uint64_t kMaxInflatedBytes = std::uint64_t{64} << 20;
constexpr std::uint32_t kMaxCharacterSetBytes = 1024;  // DCMTK's time grows with the square of their number
constexpr std::uint32_t kUndefinedLength = 0xFFFFFFFF;
constexpr std::uint64_t kUntilClosed = ~std::uint64_t{0};

// Value representations with lengths of two bytes, and of four behind two that are reserved (PS3.5 7.1.2).
constexpr std::string_view kShortVrs = "AE AS AT CS DA DS DT FL FD IS LO LT PN SH SL SS ST TM UI UL US";
constexpr std::string_view kLongVrs = "OB OD OF OL OV OW SQ SV UC UN UR UT UV";

bool is_among(std::string_view vrs, std::string_view vr) {
  for (std::size_t at = 0; at < vrs.size(); at += 3)
    if (vrs.substr(at, 2) == vr) return true;
  return false;
}

struct Encoding {
  bool is_explicit = true, is_little_endian = true;
};

struct Element {
  DcmTagKey tag;
  std::string vr;  // empty in implicit encodings
  std::uint64_t begins_at = 0, value_at = 0;
  std::uint32_t length = 0;
};

// What is open at a place: the dataset, an item, a sequence or the fragments of compressed pixels.
struct Level {
  enum class Kind { kDataset, kItem, kSequence, kFragments };
  Kind kind;
  std::uint64_t end;    // kUntilClosed: it is closed by a delimiter
  std::uint64_t limit;  // the first end of all that is open
  Encoding encoding;
};

// What the header says of an image's size, as far as it says it.
struct ImageSize {
  double rows = 0, columns = 0, bits = 0, samples = 1, frames = 1;
  double bytes() const { return rows * columns * samples * frames * bits / 8; }
};

class Walk {
 public:
  Walk(FileBytes& file, std::uint64_t at) : file_(file), at_(at) {
    open(Level::Kind::kDataset, file.size(), guessed());
  }

  // Past the file meta information, which need not be there. Its transfer syntax, empty where it names none. DCMTK
  // takes the first of two, overlooks one that is not a UI, and believes the group's length.
  std::string transfer_syntax() {
    std::string uid;
    std::uint64_t end = 0;
    DcmTagKey last(0, 0);
    while (number(file_.piece(at_, 2), true) == DCM_TransferSyntaxUID.getGroup()) {
      const Element element = next_element();
      if (element.tag <= last) fail(fmt::format("{} stands where a larger tag is expected", named(element)));
      last = element.tag;
      skip(element);
      if (element.tag == DCM_FileMetaInformationGroupLength && element.length == 4)
        end = at_ + number(bytes(element.value_at, 4), true);
      constexpr std::size_t kLongest = 64;
      if (element.tag == DCM_TransferSyntaxUID) {
        if (!element.vr.empty() && element.vr != "UI")
          fail(fmt::format("{} has the value representation {}, expected UI", named(element), element.vr));
        uid = bytes(element.value_at, std::min<std::size_t>(element.length, kLongest));
      }
    }
    if (end != 0 && end != at_)
      fail(fmt::format("{} says that the file meta information ends at byte {}, and it ends at byte {}",
                       described(DCM_FileMetaInformationGroupLength), end, at_));
    uid.resize(std::min(uid.find_last_not_of(std::string_view(" \0", 2)) + 1, uid.size()));
    levels_.front().encoding = guessed();
    // DCMTK guesses, too, and could take the bytes of other first elements for big endian.
    const std::string_view group = file_.piece(at_, 2);
    if (uid.empty() && !group.empty() && group != std::string_view("\x08\0", 2))
      fail("names no transfer syntax, and does not begin with group 0008 in little endian");
    return uid;
  }
  void set_encoding(Encoding encoding) { levels_.front().encoding = encoding; }
  std::uint64_t at() const { return at_; }

  // To the end. Where Pixel Data of the dataset itself begin: the end where there are none.
  std::uint64_t pixels_at() {
    std::uint64_t pixels_at = file_.size();
    for (;;) {
      while (levels_.size() > 1 && levels_.back().end == at_) levels_.pop_back();
      const Level level = levels_.back();
      if (levels_.size() == 1 && at_ == level.end) return pixels_at;
      const Element element = next_element();
      if (level.kind == Level::Kind::kSequence || level.kind == Level::Kind::kFragments) {
        enter_item(level, element);
      } else if (level.kind == Level::Kind::kItem && element.tag == DCM_ItemDelimitationItemTag) {
        close(level, element);
      } else {
        if (levels_.size() == 1) expect_in_order(element);
        if (levels_.size() == 1 && element.tag == DCM_PixelData) pixels_at = element.begins_at;
        enter(level, element);
      }
    }
  }

 private:
  // Datasets that do not name their transfer syntax are little endian. VRs are explicit where the first element has it.
  Encoding guessed() const {
    const std::string_view head = file_.piece(at_, 6);
    return {.is_explicit =
                head.size() == 6 && (is_among(kShortVrs, head.substr(4)) || is_among(kLongVrs, head.substr(4)))};
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw Error(fmt::format("{}: {}", file_.path().string(), what));
  }
  [[noreturn]] void fail_as_no_part(const Element& element) const {
    fail(fmt::format("{} bytes from byte {} on are not part of its dataset", file_.size() - element.begins_at,
                     element.begins_at));
  }
  static std::string named(const Element& element) {
    return fmt::format("{} at byte {}", described(element.tag), element.begins_at);
  }

  std::string_view bytes(std::uint64_t at, std::size_t count) const {
    const std::string_view found = file_.piece(at, count);
    if (found.size() < count) fail_as_cut_off();
    return found;
  }
  [[noreturn]] void fail_as_cut_off() const { fail(kIsCutOff); }

  static std::uint32_t number(std::string_view bytes, bool is_little_endian) {
    std::uint32_t value = 0;
    for (std::size_t n = 0; n < bytes.size(); ++n)
      value |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[n]))
               << 8 * (is_little_endian ? n : bytes.size() - 1 - n);
    return value;
  }

  void open(Level::Kind kind, std::uint64_t end, Encoding encoding) {
    if (levels_.size() > 2 * kMaxDepth) fail(fmt::format("its sequences are nested more than {} deep", kMaxDepth));
    const std::uint64_t around = levels_.empty() ? end : levels_.back().limit;
    levels_.push_back({kind, end, std::min(end, around), encoding});
  }

  // Behind the tag, the VR and the length. Items and delimiters have no VR in any encoding.
  Element next_element() {
    const std::uint64_t most =
        std::min<std::uint64_t>(kMaxElements, kElementsOfAnySize + file_.size() / kLeastMeanBytes);
    if (++elements_ > most) fail(fmt::format("has more than {} elements", most));
    const Level& level = levels_.back();
    const bool is_little_endian = level.encoding.is_little_endian;
    if (level.limit - at_ < 8) fail_at_end_of(level);
    const std::string head(bytes(at_, 8));
    Element element{.tag = {static_cast<Uint16>(number(head.substr(0, 2), is_little_endian)),
                            static_cast<Uint16>(number(head.substr(2, 2), is_little_endian))},
                    .vr = {},
                    .begins_at = at_,
                    .value_at = at_ + 8};
    if (!level.encoding.is_explicit || element.tag.getGroup() == 0xFFFE) {
      element.length = number(head.substr(4), is_little_endian);
    } else {
      element.vr = head.substr(4, 2);
      if (is_among(kShortVrs, element.vr)) {
        element.length = number(head.substr(6), is_little_endian);
      } else if (is_among(kLongVrs, element.vr)) {
        if (level.limit - at_ < 12) fail_at_end_of(level);
        element.length = number(bytes(at_ + 8, 4), is_little_endian);
        element.value_at += 4;
      } else {
        if (levels_.size() == 1 && element.tag.getGroup() == 0) fail_as_no_part(element);
        fail(fmt::format("at byte {} no DICOM element begins: found {:02X}", at_,
                         fmt::join(std::vector<unsigned char>(head.begin(), head.end()), " ")));
      }
    }
    at_ = element.value_at;
    return element;
  }

  [[noreturn]] void fail_at_end_of(const Level& level) const {
    const std::string_view left = file_.piece(at_, 8);
    if (levels_.size() == 1 && left.find_first_not_of('\0') == std::string_view::npos)
      fail(fmt::format("{} bytes from byte {} on are not part of its dataset", left.size(), at_));
    if (level.limit == file_.size()) fail_as_cut_off();
    fail(fmt::format("at byte {} an element is longer than the item around it", at_));
  }

  // Skips a value.
  void skip(const Element& element) {
    const Level& level = levels_.back();
    if (element.length > level.limit - element.value_at) {
      if (level.limit == file_.size()) fail_as_cut_off();
      fail(fmt::format("{} is longer than the item around it", named(element)));
    }
    at_ = element.value_at + element.length;
  }

  void close(const Level& level, const Element& element) {
    if (level.end != kUntilClosed) fail(fmt::format("{} ends an item or a sequence of defined length", named(element)));
    levels_.pop_back();
  }

  // In a sequence or among fragments.
  void enter_item(const Level& level, const Element& element) {
    if (element.tag == DCM_SequenceDelimitationItemTag) {
      close(level, element);
    } else if (element.tag != DCM_ItemTag) {
      fail(fmt::format("{} stands where an item of a sequence is expected", named(element)));
    } else if (level.kind == Level::Kind::kFragments) {
      skip(element);
      if (levels_.size() == 2)
        check_pixel_bytes(fragment_bytes_ += element.length, 2.0);
      else
        count_bytes(element);
    } else if (element.length == kUndefinedLength) {
      open(Level::Kind::kItem, kUntilClosed, level.encoding);
    } else {
      skip(element);
      at_ = element.value_at;
      open(Level::Kind::kItem, element.value_at + element.length, level.encoding);
    }
  }

  // In a dataset or an item.
  void enter(const Level& level, const Element& element) {
    if (element.tag.getGroup() == 0xFFFE) fail(fmt::format("{} stands outside of a sequence", named(element)));
    const bool is_top = levels_.size() == 1;
    if (element.length == kUndefinedLength) {
      if (element.tag == DCM_PixelData)
        open(Level::Kind::kFragments, kUntilClosed, level.encoding);
      else
        open(Level::Kind::kSequence, kUntilClosed, encoding_in(level, element));
      return;
    }
    skip(element);
    if (is_top && element.tag == DCM_PixelData) check_pixel_bytes(element.length, 1.0);
    if (is_top) note_size(level, element);
    if (!is_sequence(element)) {
      if (!is_top || element.tag != DCM_PixelData) count_bytes(element);
      return;
    }
    at_ = element.value_at;
    open(Level::Kind::kSequence, element.value_at + element.length, encoding_in(level, element));
  }

  // A value at any depth, but for the pixels.
  void count_bytes(const Element& element) {
    header_bytes_ += element.length;
    if (header_bytes_ > kMaxHeaderBytes)
      fail(fmt::format("has more than {} MiB besides its pixels", kMaxHeaderBytes >> 20));
    if (element.tag == DCM_SpecificCharacterSet && element.length > kMaxCharacterSetBytes)
      fail(fmt::format("{} has {} bytes, expected at most {}", named(element), element.length, kMaxCharacterSetBytes));
  }

  // PS3.5 6.2.2: what is in an element of unknown VR is implicit little endian.
  static Encoding encoding_in(const Level& level, const Element& element) {
    return element.vr == "UN" ? Encoding{.is_explicit = false, .is_little_endian = true} : level.encoding;
  }

  // Without a VR the dictionary tells; values of private elements are not looked into, by DCMTK neither.
  static bool is_sequence(const Element& element) {
    if (!element.vr.empty() && element.vr != "UN") return element.vr == "SQ";
    return element.length >= 8 && DcmTag(element.tag).getEVR() == EVR_SQ;
  }

  void note_size(const Level& level, const Element& element) {
    const auto short_number = [&](double& into, double most) {
      if (element.length == 2)
        into = std::min<double>(number(bytes(element.value_at, 2), level.encoding.is_little_endian), most);
    };
    constexpr double kMostBits = 64, kMostSamples = 4;  // of any image of PS3.3
    if (element.tag == DCM_Rows) short_number(image_.rows, kMaxEdge);
    if (element.tag == DCM_Columns) short_number(image_.columns, kMaxEdge);
    if (element.tag == DCM_BitsAllocated) short_number(image_.bits, kMostBits);
    if (element.tag == DCM_SamplesPerPixel) short_number(image_.samples, kMostSamples);
    if (element.tag == DCM_NumberOfFrames && element.length <= 12)
      image_.frames = std::clamp(std::strtod(std::string(bytes(element.value_at, element.length)).c_str(), nullptr),
                                 0.0, static_cast<double>(kMaxFrames));
  }

  // Native pixels take what the header says, and a byte that makes their number even; compressed ones may take more,
  // with the headers of their streams. Where the header does not say, a reader will; until then the bound is another.
  void check_pixel_bytes(std::uint64_t found, double share) const {
    constexpr double kStreamHeaders = 1 << 20;
    const double needed = share > 1.0 ? share * image_.bytes() + kStreamHeaders : 2.0 * std::ceil(image_.bytes() / 2.0);
    if (image_.bytes() > 0.0 && static_cast<double>(found) > needed)
      fail(fmt::format("{} holds {} bytes, more than its {} x {} pixels take", described(DCM_PixelData), found,
                       image_.columns, image_.rows));
    if (!(image_.bytes() > 0.0) && found > kMaxHeaderBytes)
      fail(fmt::format("{} holds {} bytes, and the header does not say of how many pixels", described(DCM_PixelData),
                       found));
  }

  // Groups up to 0003 are no part of a dataset (PS3.5 7.1), and behind the pixels tags only ascend.
  void expect_in_order(const Element& element) {
    const bool is_behind_pixels = last_ >= DCM_PixelData && element.tag <= last_;
    if (element.tag.getGroup() < 0x0004 || is_behind_pixels) fail_as_no_part(element);
    last_ = element.tag;
  }

  FileBytes& file_;
  std::uint64_t at_;
  std::vector<Level> levels_;
  std::size_t elements_ = 0;
  std::uint64_t header_bytes_ = 0, fragment_bytes_ = 0;
  ImageSize image_;
  DcmTagKey last_{0, 0};
};

// PS3.5 A.5: deflated without a header, and padded to an even length.
std::string inflated(std::string_view bytes, const std::filesystem::path& path) {
  const auto fail = [&](std::string_view why) {
    throw Error(fmt::format("{}: its deflated dataset {}", path.string(), why));
  };
  z_stream stream{};
  if (inflateInit2(&stream, -MAX_WBITS) != Z_OK) throw std::bad_alloc();
  const std::unique_ptr<z_stream, decltype(&inflateEnd)> ends_it(&stream, &inflateEnd);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  std::string whole;
  for (int state = Z_OK; state != Z_STREAM_END;) {
    const std::size_t have = whole.size();
    if (have >= kMaxInflatedBytes) fail(fmt::format("is larger than {} MiB", kMaxInflatedBytes >> 20));
    whole.resize(have + FileBytes::kLongestPiece);
    stream.next_out = reinterpret_cast<Bytef*>(whole.data() + have);
    stream.avail_out = FileBytes::kLongestPiece;
    state = inflate(&stream, Z_NO_FLUSH);
    whole.resize(whole.size() - stream.avail_out);
    if (state == Z_BUF_ERROR) fail("ends too early: the file has been cut off, or is still being written");
    if (state != Z_OK && state != Z_STREAM_END) fail("is damaged");
  }
  if (stream.avail_in > 1) fail(fmt::format("is followed by {} bytes that are not part of it", stream.avail_in));
  return whole;
}

// The transfer syntaxes that neither we nor gdcmconv decode, by what their UIDs begin with (PS3.6 A-1).
void refuse_what_nobody_converts(std::string_view uid, const std::filesystem::path& path) {
  for (const auto& [begin, name] : {std::pair("1.2.840.10008.1.2.4.20", "High-Throughput JPEG 2000"),
                                    std::pair("1.2.840.10008.1.2.4.11", "JPEG XL")})
    if (uid.starts_with(begin) && uid.size() == std::string_view(begin).size() + 1)
      throw Error(
          fmt::format("{}: {} is {}, {}, which isoshift does not decode.\n       Export the images again, "
                      "uncompressed or with JPEG 2000, JPEG-LS, JPEG or RLE",
                      path.string(), described(DCM_TransferSyntaxUID), uid, name));
}

}  // namespace

FileStructure structure_of(FileBytes& file) {
  constexpr std::size_t kPreamble = 132;
  const std::string_view preamble = file.piece(0, kPreamble);
  const bool has_preamble = preamble.size() == kPreamble && preamble.ends_with("DICM");
  Walk walk(file, has_preamble ? kPreamble : 0);
  if (const std::string uid = walk.transfer_syntax(); !uid.empty()) {
    refuse_what_nobody_converts(uid, file.path());
    const DcmXfer syntax(uid.c_str());
    // DCMTK would take it for explicit little endian, and its pixels for what they are not.
    if (syntax.getXfer() == EXS_Unknown)
      throw Error(fmt::format("{}: {} is {}, which isoshift does not know.\n       {}", file.path().string(),
                              described(DCM_TransferSyntaxUID), uid, kConvertFirst));
    if (syntax.getStreamCompression() != ESC_none) {
      const std::string bytes =
          inflated(std::string_view(file.whole(kMaxInflatedBytes)).substr(walk.at()), file.path());
      FileBytes dataset(bytes, file.path());
      Walk inside(dataset, 0);
      inside.set_encoding({.is_explicit = true, .is_little_endian = true});
      inside.pixels_at();
      return {.is_deflated = true, .header_end = file.size()};
    }
    walk.set_encoding({.is_explicit = syntax.isExplicitVR(), .is_little_endian = syntax.isLittleEndian()});
  }
  return {.header_end = walk.pixels_at()};
}

}  // namespace isoshift
