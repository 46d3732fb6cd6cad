#pragma once
// DICOM files behind a small interface: the only place of isoshift that sees OFCondition. Every failure becomes an
// Error that names the file, the attribute by keyword and tag, and what was found.

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcdeftag.h>
#include <dcmtk/dcmdata/dcvr.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

class DcmFileFormat;
class DcmItem;

namespace isoshift {

class FileBytes;
class Sha256;

// "RTImageSID (3002,0026)".
std::string described(const DcmTagKey& tag);

// A dataset or an item of a sequence: borrowed from the DicomFile it came from.
class DicomItem {
 public:
  DicomItem(DcmItem& item, std::string where) : item_(&item), where_(std::move(where)) {}

  // The file, and for an item its sequence, as a message names it.
  const std::string& where() const { return where_; }

  // The attributes it has, those without a value too, and their VRs.
  std::vector<std::pair<DcmTagKey, DcmEVR>> elements() const;

  // Reading. Absent and empty are the same: nothing. Values lose their padding; text is UTF-8 where convertible, and
  // its control characters are spaces, so that no file can forge a line of a message or report.
  bool has_value(const DcmTagKey& tag) const;
  std::optional<std::string> text(const DcmTagKey& tag) const;
  std::optional<std::string> raw_text(const DcmTagKey& tag) const;  // with control characters, to copy to another file
  std::vector<std::string> texts(const DcmTagKey& tag) const;
  std::optional<std::string> uid(const DcmTagKey& tag) const;  // throws Error for what cannot be meant as one
  std::optional<double> number(const DcmTagKey& tag) const;    // throws Error for several: which of them counts?
  std::vector<double> numbers(const DcmTagKey& tag) const;
  std::optional<int> integer(const DcmTagKey& tag) const;  // throws Error for what is no whole number of 32 bits
  std::vector<DicomItem> items(const DcmTagKey& sequence) const;

  // The same for what must be there; `count` numbers, all finite.
  std::string required_text(const DcmTagKey& tag) const;
  std::string required_uid(const DcmTagKey& tag) const;
  double required_number(const DcmTagKey& tag) const;
  int required_integer(const DcmTagKey& tag) const;
  std::vector<double> required_numbers(const DcmTagKey& tag, std::size_t count) const;

  // Writing. The VR comes from the data dictionary; DS values are shortened to 16 bytes, never cut (ds_from).
  void put(const DcmTagKey& tag, std::string_view text);
  void put(const DcmTagKey& tag, std::span<const double> numbers);
  void put(const DcmTagKey& tag, double number) { put(tag, std::span(&number, 1)); }
  void put_pixels(std::span<const std::uint16_t> stored_values);
  void put_bytes(const DcmTagKey& tag, std::string_view bytes);  // OB, padded to an even length
  DicomItem append_item(const DcmTagKey& sequence);
  DicomItem append_reference(const DcmTagKey& sequence, std::string_view sop_class_uid, std::string_view instance_uid);
  void put_empty_sequence(const DcmTagKey& sequence);
  void erase(const DcmTagKey& tag);

  DcmItem& dcmtk() const { return *item_; }

 private:
  // All values of a text, with the backslashes between them.
  std::optional<std::string> written(const DcmTagKey& tag) const;

  DcmItem* item_;
  std::string where_;
};

// Throws Error if a dataset says that it is of another modality than the objects of its class are.
void expect_modality(const DicomItem& dataset, std::string_view modality);

class DicomFile {
 public:
  enum class Extent { kHeader, kWhole };  // kHeader stops before the pixel data

  DicomFile();  // a new, empty object
  // Reads the file once: header, pixels and SHA-256 come from the same bytes.
  static DicomFile read(const std::filesystem::path& path, Extent extent);
  // The same of bytes that are at hand, without a hash and without converting texts to UTF-8.
  DicomFile(FileBytes& bytes, Extent extent);
  DicomFile(DicomFile&&) noexcept;
  DicomFile& operator=(DicomFile&&) noexcept;
  ~DicomFile();

  const std::filesystem::path& path() const { return path_; }
  const std::string& sha256() const { return sha256_; }  // of the bytes that were read; of a file that was read whole
  DicomItem dataset() const;
  bool is_compressed() const;  // the pixels: in no native transfer syntax (PS3.5 A.4)

  // Explicit little endian, flushed to the disk. The file must not exist.
  void write(const std::filesystem::path& path);

 private:
  void load(FileBytes& bytes, Extent extent, Sha256* sha256);

  std::unique_ptr<DcmFileFormat> file_;
  std::filesystem::path path_;
  std::string sha256_;
};

// How a file begins.
enum class Beginning {
  kDicom,    // 128 bytes, then "DICM" (PS3.10), or, as old exports do, with the first element of a dataset
  kNothing,  // empty, or zeros: programs that copy may make the file whole first, and fill it then
  kOther,
};
// Throws Error if the file cannot be read.
Beginning beginning_of(const std::filesystem::path& path);

// Whether a file of this name may be meant as a DICOM file: without extension, or with .dcm, .ima or, at the end of a
// UID, digits.
bool is_named_like_dicom(const std::filesystem::path& path);

// A DS value: at most 16 bytes, the nearest decimal that fits, 0 for what is smaller than 1e-12.
std::string ds_from(double number);

// A UID "2.25.<UUID>" (PS3.5 B.2) from 16 random bytes.
std::string uid_from_random_bytes(std::array<std::uint8_t, 16> bytes);
std::string new_uid();

}  // namespace isoshift
