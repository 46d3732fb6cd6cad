#include "io/dicom/dicom_dataset.h"

#include <dcmtk/dcmdata/dcistrmb.h>
#include <dcmtk/dcmdata/dcostrmb.h>
#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <random>
#include <utility>

#include "base/error.h"
#include "base/output_folder.h"
#include "base/sha256.h"
#include "base/text_file.h"
#include "io/dicom/file_bytes.h"
#include "io/dicom/file_structure.h"

namespace isoshift {
namespace {

void check(const OFCondition& condition, const std::string& where, std::string_view doing) {
  if (condition.bad()) throw Error(fmt::format("{}: {}: {}", where, doing, condition.text()));
}

// Once per process, before any thread reads a file.
void configure_dcmtk() {
  static const bool configured = [] {
    // Contours longer than 65534 bytes come as UN (PS3.5 6.2.2); DCMTK's warnings may quote patient data.
    dcmEnableUnknownVRConversion.set(OFTrue);
    OFLog::configure(OFLogger::OFF_LOG_LEVEL);
    return true;
  }();
  (void)configured;
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kPadding("\0 \t\r\n", 5);
  const auto begin = text.find_first_not_of(kPadding);
  if (begin == std::string_view::npos) return {};
  return text.substr(begin, text.find_last_not_of(kPadding) - begin + 1);
}

void make_printable(std::string& text) {
  for (char& c : text)
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = ' ';
}

bool is_text_vr(DcmEVR vr) { return vr == EVR_DS || vr == EVR_IS; }

// The values of an element, separated by backslashes. DCMTK, asked for them as an array, would look through all of a
// text once for each value.
std::optional<std::string> values_of(DcmElement& element) {
  char* text = nullptr;
  Uint32 length = 0;
  if (element.isaString() && element.getString(text, length).good())
    return text == nullptr ? std::string() : std::string(text, length);
  OFString values;
  if (element.getOFStringArray(values).bad()) return std::nullopt;
  return values;
}

}  // namespace

std::string described(const DcmTagKey& key) {
  DcmTag tag(key);
  return fmt::format("{} ({:04X},{:04X})", tag.getTagName(), key.getGroup(), key.getElement());
}

std::vector<std::pair<DcmTagKey, DcmEVR>> DicomItem::elements() const {
  std::vector<std::pair<DcmTagKey, DcmEVR>> elements;
  for (DcmObject* element = item_->nextInContainer(nullptr); element != nullptr;
       element = item_->nextInContainer(element))
    elements.emplace_back(element->getTag(), element->ident());
  return elements;
}

bool DicomItem::has_value(const DcmTagKey& tag) const { return item_->tagExistsWithValue(tag); }

std::optional<std::string> DicomItem::written(const DcmTagKey& tag) const {
  DcmElement* element = nullptr;
  if (!has_value(tag) || item_->findAndGetElement(tag, element).bad()) return std::nullopt;
  std::optional<std::string> all = values_of(*element);
  if (!all) throw Error(fmt::format("{}: {} is not text", where_, described(tag)));
  return all;
}

std::vector<std::string> DicomItem::texts(const DcmTagKey& tag) const {
  const std::optional<std::string> whole = written(tag);
  if (!whole) return {};
  std::vector<std::string> values;
  std::string_view rest = *whole;
  for (;;) {
    const auto separator = rest.find('\\');
    make_printable(values.emplace_back(trimmed(rest.substr(0, separator))));
    if (separator == std::string_view::npos) break;
    rest.remove_prefix(separator + 1);
  }
  return values;
}

std::optional<std::string> DicomItem::text(const DcmTagKey& tag) const {
  auto value = raw_text(tag);
  if (value) make_printable(*value);
  return value;
}

std::optional<std::string> DicomItem::raw_text(const DcmTagKey& tag) const {
  const std::optional<std::string> whole = written(tag);
  if (!whole || trimmed(*whole).empty()) return std::nullopt;
  return std::string(trimmed(*whole));
}

std::vector<double> DicomItem::numbers(const DcmTagKey& tag) const {
  DcmElement* element = nullptr;
  if (!has_value(tag) || item_->findAndGetElement(tag, element).bad()) return {};
  std::vector<double> values;
  if (is_text_vr(element->ident())) {
    for (const std::string& written : texts(tag)) {
      std::string_view digits = written;
      if (digits.starts_with('+')) digits.remove_prefix(1);
      double value = 0.0;
      const auto [end, error] = std::from_chars(digits.begin(), digits.end(), value);
      if (error != std::errc() || end != digits.end() || !std::isfinite(value))
        throw Error(fmt::format("{}: {} holds \"{}\", which is not a finite number", where_, described(tag), written));
      values.push_back(value);
    }
    return values;
  }
  for (unsigned long n = 0; n < element->getVM(); ++n) {
    Float64 wide = 0.0;
    Float32 narrow = 0.0F;
    Uint32 whole = 0;
    Sint32 whole_signed = 0;
    Uint16 small = 0;
    Sint16 small_signed = 0;
    if (element->getFloat64(wide, n).good())
      values.push_back(wide);
    else if (element->getFloat32(narrow, n).good())
      values.push_back(narrow);
    else if (element->getUint16(small, n).good())
      values.push_back(small);
    else if (element->getSint16(small_signed, n).good())
      values.push_back(small_signed);
    else if (element->getUint32(whole, n).good())
      values.push_back(whole);
    else if (element->getSint32(whole_signed, n).good())
      values.push_back(whole_signed);
    else
      throw Error(fmt::format("{}: {} is not a number", where_, described(tag)));
    if (!std::isfinite(values.back()))
      throw Error(fmt::format("{}: {} is not a finite number", where_, described(tag)));
  }
  return values;
}

std::optional<double> DicomItem::number(const DcmTagKey& tag) const {
  if (numbers(tag).empty()) return std::nullopt;
  return required_number(tag);
}

// An IS value is one of 32 bits (PS3.5 6.2).
std::optional<int> DicomItem::integer(const DcmTagKey& tag) const {
  const std::optional<double> value = number(tag);
  if (!value) return std::nullopt;
  if (!(std::abs(*value) <= std::numeric_limits<int>::max()) || *value != std::floor(*value))
    throw Error(fmt::format("{}: {} is {}, expected a whole number", where_, described(tag), *value));
  return static_cast<int>(*value);
}

std::optional<std::string> DicomItem::uid(const DcmTagKey& tag) const {
  // Some programs that take names out of files write hexadecimal digits and hyphens, too.
  constexpr std::size_t kLongest = 64;
  const auto may_be_in_uid = [](unsigned char c) { return std::isalnum(c) != 0 || c == '.' || c == '-'; };
  auto value = text(tag);
  if (value && (value->size() > kLongest || !std::ranges::all_of(*value, may_be_in_uid)))
    throw Error(fmt::format("{}: {} is \"{}\", which is no UID: expected at most {} digits and dots", where_,
                            described(tag), value->substr(0, 2 * kLongest), kLongest));
  return value;
}

std::vector<DicomItem> DicomItem::items(const DcmTagKey& sequence_tag) const {
  DcmSequenceOfItems* sequence = nullptr;
  if (item_->findAndGetSequence(sequence_tag, sequence).bad() || sequence == nullptr) return {};
  std::vector<DicomItem> items;
  items.reserve(sequence->card());
  // From one item to the next: getItem(n) counts from the first, which takes half a minute for 200 000 contours.
  const std::string prefix = fmt::format("{}: {} item ", where_, described(sequence_tag));
  for (DcmObject* item = sequence->nextInContainer(nullptr); item != nullptr; item = sequence->nextInContainer(item))
    items.emplace_back(static_cast<DcmItem&>(*item), fmt::format("{}{}", prefix, items.size() + 1));
  return items;
}

std::string DicomItem::required_text(const DcmTagKey& tag) const {
  auto value = text(tag);
  if (!value) throw Error(fmt::format("{}: {} is missing", where_, described(tag)));
  return *value;
}

std::string DicomItem::required_uid(const DcmTagKey& tag) const {
  auto value = uid(tag);
  if (!value) throw Error(fmt::format("{}: {} is missing", where_, described(tag)));
  return *value;
}

double DicomItem::required_number(const DcmTagKey& tag) const { return required_numbers(tag, 1).front(); }

int DicomItem::required_integer(const DcmTagKey& tag) const {
  const auto value = integer(tag);
  if (!value) throw Error(fmt::format("{}: {} is missing", where_, described(tag)));
  return *value;
}

std::vector<double> DicomItem::required_numbers(const DcmTagKey& tag, std::size_t count) const {
  std::vector<double> values = numbers(tag);
  if (values.empty()) throw Error(fmt::format("{}: {} is missing", where_, described(tag)));
  if (values.size() != count)
    throw Error(fmt::format("{}: {} has {} values, expected {}", where_, described(tag), values.size(), count));
  return values;
}

void DicomItem::put(const DcmTagKey& tag, std::string_view text) {
  check(item_->putAndInsertOFStringArray(tag, OFString(text.data(), text.size())), where_, described(tag));
}

void DicomItem::put(const DcmTagKey& key, std::span<const double> numbers) {
  const DcmEVR vr = DcmTag(key).getEVR();
  if (is_text_vr(vr)) {
    std::string joined;
    for (const double number : numbers) joined += (joined.empty() ? "" : "\\") + ds_from(number);
    put(key, joined);
    return;
  }
  for (unsigned long n = 0; n < numbers.size(); ++n) {
    const double number = numbers[n];
    OFCondition done;
    switch (vr) {
      case EVR_xs:  // US or SS by PixelRepresentation
      case EVR_US: done = item_->putAndInsertUint16(key, static_cast<Uint16>(number), n); break;
      case EVR_SS: done = item_->putAndInsertSint16(key, static_cast<Sint16>(number), n); break;
      case EVR_UL: done = item_->putAndInsertUint32(key, static_cast<Uint32>(number), n); break;
      case EVR_FL: done = item_->putAndInsertFloat32(key, static_cast<Float32>(number), n); break;
      case EVR_FD: done = item_->putAndInsertFloat64(key, number, n); break;
      default: throw Error(fmt::format("{}: {} takes no number", where_, described(key)));
    }
    check(done, where_, described(key));
  }
}

void DicomItem::put_pixels(std::span<const std::uint16_t> stored_values) {
  check(item_->putAndInsertUint16Array(DCM_PixelData, stored_values.data(), stored_values.size()), where_,
        described(DCM_PixelData));
}

void DicomItem::put_bytes(const DcmTagKey& tag, std::string_view bytes) {
  std::string even(bytes);
  if (even.size() % 2 != 0) even.push_back('\0');
  check(item_->putAndInsertUint8Array(tag, reinterpret_cast<const Uint8*>(even.data()), even.size()), where_,
        described(tag));
}

DicomItem DicomItem::append_item(const DcmTagKey& sequence) {
  DcmItem* item = nullptr;
  check(item_->findOrCreateSequenceItem(sequence, item, -2), where_, described(sequence));
  return DicomItem(*item, fmt::format("{}: {}", where_, described(sequence)));
}

DicomItem DicomItem::append_reference(const DcmTagKey& sequence, std::string_view sop_class_uid,
                                      std::string_view instance_uid) {
  DicomItem item = append_item(sequence);
  item.put(DCM_ReferencedSOPClassUID, sop_class_uid);
  item.put(DCM_ReferencedSOPInstanceUID, instance_uid);
  return item;
}

void DicomItem::put_empty_sequence(const DcmTagKey& sequence) {
  check(item_->insertEmptyElement(sequence), where_, described(sequence));
}

void DicomItem::erase(const DcmTagKey& tag) {
  if (item_->tagExists(tag)) check(item_->findAndDeleteElement(tag), where_, described(tag));
}

void expect_modality(const DicomItem& dataset, std::string_view modality) {
  if (const auto found = dataset.text(DCM_Modality); found && *found != modality)
    throw Error(fmt::format("{}: {} is {}, expected {}", dataset.where(), described(DCM_Modality), *found, modality));
}

DicomFile::DicomFile() : path_("new DICOM object") {
  configure_dcmtk();
  file_ = std::make_unique<DcmFileFormat>();
}
DicomFile::DicomFile(DicomFile&&) noexcept = default;
DicomFile& DicomFile::operator=(DicomFile&&) noexcept = default;
DicomFile::~DicomFile() = default;

DicomFile DicomFile::read(const std::filesystem::path& path, Extent extent) {
  FileBytes bytes(path);
  DicomFile file;
  Sha256 sha256;
  file.load(bytes, extent, extent == Extent::kWhole ? &sha256 : nullptr);
  if (extent == Extent::kWhole) file.sha256_ = sha256.hex();
  // Where the character set is unknown to the converter, the bytes stay as they are, together with their set.
  (void)file.file_->getDataset()->convertToUTF8();
  return file;
}

DicomFile::DicomFile(FileBytes& bytes, Extent extent) : DicomFile() { load(bytes, extent, nullptr); }

void DicomFile::load(FileBytes& bytes, Extent extent, Sha256* sha256) {
  path_ = bytes.path();
  const FileStructure structure = structure_of(bytes);
  const std::string deflated = structure.is_deflated ? bytes.whole(bytes.size()) : "";
  const std::uint64_t end = extent == Extent::kHeader ? structure.header_end : bytes.size();
  DcmInputBufferStream stream;
  OFCondition loaded = EC_StreamNotifyClient;
  file_->transferInit();
  for (std::uint64_t at = 0; loaded == EC_StreamNotifyClient;) {
    const auto left = static_cast<std::size_t>(std::min<std::uint64_t>(end - at, FileBytes::kLongestPiece));
    const std::string_view piece = structure.is_deflated ? std::string_view(deflated) : bytes.piece(at, left);
    at += piece.size();
    if (sha256 != nullptr) sha256->add(piece);
    stream.setBuffer(piece.data(), static_cast<offile_off_t>(piece.size()));
    if (at == end || piece.empty()) stream.setEos();
    loaded = extent == Extent::kWhole
                 ? file_->read(stream, EXS_Unknown, EGL_noChange, DCM_MaxReadLength)
                 : file_->readUntilTag(stream, EXS_Unknown, EGL_noChange, DCM_MaxReadLength, DCM_PixelData);
    stream.releaseBuffer();
  }
  file_->transferEnd();
  if (loaded == EC_InvalidStream || loaded == EC_EndOfStream)
    throw Error(fmt::format("{}: {}", path_.string(), kIsCutOff));
  if (loaded.bad()) throw Error(fmt::format("{}: cannot be read as a DICOM file: {}", path_.string(), loaded.text()));
}

DicomItem DicomFile::dataset() const { return DicomItem(*file_->getDataset(), path_.string()); }

// DcmXfer's own test has another name in DCMTK 3.6.9 than in 3.6.7.
bool DicomFile::is_compressed() const {
  const E_TransferSyntax syntax = file_->getDataset()->getOriginalXfer();
  return syntax != EXS_LittleEndianImplicit && syntax != EXS_LittleEndianExplicit && syntax != EXS_BigEndianExplicit &&
         syntax != EXS_DeflatedLittleEndianExplicit && syntax != EXS_Unknown;
}

void DicomFile::write(const std::filesystem::path& path) {
  const std::string where = path.string();
  if (std::filesystem::exists(path)) throw Error(fmt::format("{}: exists already", where));
  // In memory first: DCMTK does not notice that the last bytes of a file cannot be written.
  std::vector<char> buffer(FileBytes::kLongestPiece);
  DcmOutputBufferStream stream(buffer.data(), static_cast<offile_off_t>(buffer.size()));
  std::string bytes;
  OFCondition written = EC_StreamNotifyClient;
  file_->transferInit();
  while (written == EC_StreamNotifyClient) {
    written = file_->write(stream, EXS_LittleEndianExplicit, EET_ExplicitLength, nullptr, EGL_recalcGL, EPD_noChange, 0,
                           0, 0, EWM_createNewMeta);
    void* filled = nullptr;
    offile_off_t size = 0;
    stream.flushBuffer(filled, size);
    bytes.append(static_cast<const char*>(filled), static_cast<std::size_t>(size));
  }
  file_->transferEnd();
  check(written, where, "cannot be written");
  write_text(path, bytes);
  flush(path);
}

Beginning beginning_of(const std::filesystem::path& path) {
  expect_no_pipe(path);
  std::ifstream stream(path, std::ios::binary);
  std::array<char, 132> head{};
  if (!stream) throw Error(fmt::format("{}: cannot be opened: {}", path.string(), std::strerror(errno)));
  stream.read(head.data(), head.size());
  if (std::ranges::count(head, '\0') == static_cast<std::ptrdiff_t>(head.size())) return Beginning::kNothing;
  if (stream.gcount() < 132) return Beginning::kOther;
  const std::string_view begin(head.data(), head.size());
  if (begin.substr(128) == "DICM") return Beginning::kDicom;
  // Little endian: an element of group 0008 up to SOP Instance UID, with its VR or, in implicit VR, a short length.
  const auto byte = [&](std::size_t n) { return static_cast<unsigned char>(head[n]); };
  if (byte(0) != 0x08 || byte(1) != 0 || byte(2) > 0x18 || byte(3) != 0) return Beginning::kOther;
  const std::string_view vr = begin.substr(4, 2);
  const bool is_vr =
      vr == "UL" || vr == "CS" || vr == "UI" || vr == "DA" || vr == "TM" || (byte(6) == 0 && byte(7) == 0);
  return is_vr ? Beginning::kDicom : Beginning::kOther;
}

bool is_named_like_dicom(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::ranges::transform(extension, extension.begin(), [](unsigned char c) { return std::tolower(c); });
  const auto is_digit = [](unsigned char c) { return std::isdigit(c) != 0; };
  return extension.empty() || extension == ".dcm" || extension == ".ima" ||
         std::ranges::all_of(std::string_view(extension).substr(1), is_digit);
}

std::string ds_from(double number) {
  if (!std::isfinite(number)) throw Error("a DICOM decimal string cannot hold a number that is not finite");
  if (std::abs(number) < 1e-12) return "0";
  // Fewer digits until it fits: cutting the text could drop an exponent's last digit and change the value silently.
  for (int digits = 17; digits > 0; --digits) {
    std::array<char, 40> text{};
    const auto result =
        std::to_chars(text.data(), text.data() + text.size(), number, std::chars_format::general, digits);
    if (const auto length = result.ptr - text.data(); length <= 16) return std::string(text.data(), result.ptr);
  }
  throw Error("a number does not fit into a DICOM decimal string");
}

std::string uid_from_random_bytes(std::array<std::uint8_t, 16> bytes) {
  bytes[6] = (bytes[6] & 0x0F) | 0x40;  // RFC 4122: version 4
  bytes[8] = (bytes[8] & 0x3F) | 0x80;  // and variant 1
  std::string digits;
  while (std::ranges::any_of(bytes, [](std::uint8_t byte) { return byte != 0; })) {
    unsigned remainder = 0;  // long division of the whole number by ten
    for (std::uint8_t& byte : bytes) {
      const unsigned value = remainder * 256 + byte;
      byte = static_cast<std::uint8_t>(value / 10);
      remainder = value % 10;
    }
    digits.push_back(static_cast<char>('0' + remainder));
  }
  std::ranges::reverse(digits);
  return "2.25." + digits;
}

std::string new_uid() {
  std::random_device random;
  std::array<std::uint8_t, 16> bytes{};
  std::ranges::generate(bytes, [&] { return static_cast<std::uint8_t>(random()); });
  return uid_from_random_bytes(bytes);
}

}  // namespace isoshift
