#include "io/dicom/file_structure.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>

#include "base/error.h"
#include "io/dicom/dicom_dataset.h"
#include "tests/support/small_study.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/testdata.h"

namespace isoshift::file_structure_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

std::string little(std::uint64_t number, int bytes) {
  std::string text;
  for (int n = 0; n < bytes; ++n) text += static_cast<char>(number >> 8 * n);
  return text;
}
std::string tag(unsigned group, unsigned element) { return little(group, 2) + little(element, 2); }
std::string shorter(unsigned group, unsigned element, const std::string& vr, const std::string& value) {
  return tag(group, element) + vr + little(value.size(), 2) + value;
}
std::string longer(unsigned group, unsigned element, const std::string& vr, std::uint32_t length) {
  return tag(group, element) + vr + little(0, 2) + little(length, 4);
}
std::string item(std::uint32_t length) { return tag(0xFFFE, 0xE000) + little(length, 4); }

constexpr std::uint32_t kUndefined = 0xFFFFFFFF;
const std::string kItemEnd = tag(0xFFFE, 0xE00D) + little(0, 4), kSequenceEnd = tag(0xFFFE, 0xE0DD) + little(0, 4);
const std::string kSopClass = shorter(0x0008, 0x0016, "UI", std::string("1.2.3.4\0", 8));

std::string part_10(const std::string& transfer_syntax, const std::string& dataset) {
  const std::string uid = transfer_syntax + (transfer_syntax.size() % 2 == 1 ? std::string(1, '\0') : "");
  return std::string(128, '\0') + "DICM" + shorter(0x0002, 0x0010, "UI", uid) + dataset;
}
std::string explicit_little(const std::string& dataset) { return part_10("1.2.840.10008.1.2.1", dataset); }
std::string image(unsigned rows, unsigned columns, const std::string& pixels) {
  return kSopClass + shorter(0x0028, 0x0010, "US", little(rows, 2)) +
         shorter(0x0028, 0x0011, "US", little(columns, 2)) + shorter(0x0028, 0x0100, "US", little(16, 2)) + pixels;
}

std::string deflated(const std::string& bytes) {
  z_stream stream{};
  deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, -MAX_WBITS, 9, Z_DEFAULT_STRATEGY);
  std::string out(deflateBound(&stream, bytes.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

std::string error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}
std::string error_of(const std::string& file) {
  return error_of([&] {
    FileBytes bytes(file, "X.dcm");
    structure_of(bytes);
  });
}

TEST(FileStructure, EveryFileOfTestdataThatCanBeReadHasNone) {
  int read = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(testdata(""))) {
    if (!entry.is_regular_file() || entry.path().string().find("/damaged/") != std::string::npos) continue;
    if (beginning_of(entry.path()) != Beginning::kDicom) continue;
    EXPECT_EQ(error_of([&] {
                FileBytes bytes(entry.path());
                structure_of(bytes);
              }),
              "no error")
        << entry.path();
    ++read;
  }
  EXPECT_GT(read, 100);
}

TEST(FileStructure, TheHeaderEndsWhereThePixelsBegin) {
  const std::string header = explicit_little(image(2, 2, ""));
  FileBytes bytes(header + longer(0x7FE0, 0x0010, "OW", 8) + "12345678", "X.dcm");
  EXPECT_EQ(structure_of(bytes).header_end, header.size());
  FileBytes without(header, "X.dcm");
  EXPECT_EQ(structure_of(without).header_end, header.size());
}

TEST(FileStructure, SequencesOfEveryKindAreFollowed) {
  const std::string name = shorter(0x0010, 0x0010, "PN", "A^B ");
  for (const std::string& sequence :
       {longer(0x300A, 0x00B0, "SQ", 0), longer(0x300A, 0x00B0, "SQ", 20) + item(12) + name,
        longer(0x300A, 0x00B0, "SQ", kUndefined) + item(12) + name + kSequenceEnd,
        longer(0x300A, 0x00B0, "SQ", kUndefined) + item(kUndefined) + name + kItemEnd + kSequenceEnd,
        longer(0x300A, 0x00B0, "SQ", 28) + item(kUndefined) + name + kItemEnd,
        // What is in an element of unknown VR is implicit.
        longer(0x300A, 0x00B0, "UN", 20) + item(12) + tag(0x0010, 0x0010) + little(4, 4) + "A^B ",
        longer(0x300B, 0x1001, "UN", kUndefined) + item(12) + tag(0x0010, 0x0010) + little(4, 4) + "A^B " +
            kSequenceEnd})
    EXPECT_EQ(error_of(explicit_little(kSopClass + sequence + shorter(0x300E, 0x0002, "CS", "APPROVED"))), "no error");
}

TEST(FileStructure, BytesBehindTheDatasetAreRefused) {
  const std::string file = explicit_little(kSopClass);
  EXPECT_EQ(error_of(file + std::string(1000, '\0')), "X.dcm: 1000 bytes from byte 176 on are not part of its dataset");
  EXPECT_THAT(error_of(file + "<html>no"), HasSubstr("X.dcm: at byte 176 no DICOM element begins"));
  const std::string pixels = longer(0x7FE0, 0x0010, "OW", 8) + "12345678";
  EXPECT_THAT(error_of(explicit_little(image(2, 2, pixels + kSopClass))), HasSubstr("are not part of its dataset"));
  EXPECT_EQ(error_of(explicit_little(image(2, 2, pixels + longer(0xFFFC, 0xFFFC, "OB", 2) + "  "))), "no error");
  // 20 GB that no disk holds.
  const TemporaryFolder folder;
  std::ofstream(folder / "sparse.dcm", std::ios::binary) << file;
  std::filesystem::resize_file(folder / "sparse.dcm", std::uintmax_t{20} << 30);
  EXPECT_THAT(error_of([&] { DicomFile::read(folder / "sparse.dcm", DicomFile::Extent::kWhole); }),
              HasSubstr("21474836304 bytes from byte 176 on are not part of its dataset"));
}

TEST(FileStructure, MorePixelsThanTheHeaderSaysAreRefused) {
  EXPECT_EQ(error_of(explicit_little(image(2, 2, longer(0x7FE0, 0x0010, "OW", 8) + "12345678"))), "no error");
  EXPECT_THAT(error_of(explicit_little(image(2, 2, longer(0x7FE0, 0x0010, "OW", 12) + "123456789012"))),
              HasSubstr("PixelData (7FE0,0010) holds 12 bytes, more than its 2 x 2 pixels take"));
  const std::string fragments = longer(0x7FE0, 0x0010, "OB", kUndefined) + item(0) + item(2 << 20);
  EXPECT_THAT(error_of(part_10("1.2.840.10008.1.2.5", image(2, 2, fragments + std::string(2 << 20, 'x')))),
              HasSubstr("more than its 2 x 2 pixels take"));
  const TemporaryFolder folder;
  std::ofstream(folder / "a.dcm", std::ios::binary)
      << explicit_little(kSopClass + longer(0x7FE0, 0x0010, "OW", 0xFFFFFFF0));
  std::filesystem::resize_file(folder / "a.dcm", 188 + std::uintmax_t{0xFFFFFFF0});
  EXPECT_THAT(
      error_of([&] { DicomFile::read(folder / "a.dcm", DicomFile::Extent::kWhole); }),
      HasSubstr("a.dcm: PixelData (7FE0,0010) holds 4294967280 bytes, and the header does not say of how many"));
}

TEST(FileStructure, MoreElementsThanAnyObjectHasAreRefused) {
  std::string many = kSopClass;
  for (unsigned n = 0; n < 600'001; ++n) many += shorter(0x0011 + 2 * (n / 0xF000), 0x1000 + n % 0xF000, "LO", "");
  EXPECT_THAT(error_of(explicit_little(many)), StartsWith("X.dcm: has more than 40"));
}

TEST(FileStructure, ALargeValueBesidesThePixelsIsRefused) {
  const TemporaryFolder folder;
  std::ofstream(folder / "a.dcm", std::ios::binary)
      << explicit_little(kSopClass + longer(0x0011, 0x1001, "OB", 1 << 30));
  std::filesystem::resize_file(folder / "a.dcm", 188 + (1 << 30));
  EXPECT_THAT(error_of([&] { DicomFile::read(folder / "a.dcm", DicomFile::Extent::kHeader); }),
              HasSubstr("a.dcm: has more than 128 MiB besides its pixels"));
}

// DCMTK would look through all of it once for each of its values.
TEST(FileStructure, ALongListOfCharacterSetsIsRefused) {
  const std::string sets(2000, '\\');
  EXPECT_THAT(error_of(explicit_little(shorter(0x0008, 0x0005, "CS", sets) + kSopClass)),
              HasSubstr("SpecificCharacterSet (0008,0005) at byte 160 has 2000 bytes, expected at most 1024"));
  const std::string in_item = shorter(0x0008, 0x0005, "CS", sets);
  EXPECT_THAT(error_of(explicit_little(kSopClass + longer(0x300A, 0x00B0, "SQ", kUndefined) + item(kUndefined) +
                                       in_item + kItemEnd + kSequenceEnd)),
              HasSubstr("has 2000 bytes, expected at most 1024"));
}

TEST(FileStructure, ElementsThatEndBehindWhatIsAroundThemAreRefused) {
  EXPECT_THAT(error_of(explicit_little(longer(0x0008, 0x0016, "UN", 100))),
              HasSubstr("X.dcm: ends before what its elements announce"));
  EXPECT_THAT(error_of(explicit_little(longer(0x300A, 0x00B0, "SQ", 20) + item(12) +
                                       shorter(0x0010, 0x0010, "PN", "A^BC^D") + kSopClass)),
              HasSubstr("X.dcm: PatientName (0010,0010) at byte 180 is longer than the item around it"));
  EXPECT_THAT(error_of(explicit_little(longer(0x300A, 0x00B0, "SQ", 12) + item(4) + "1234" + kSopClass)),
              HasSubstr("X.dcm: at byte 180 an element is longer than the item around it"));
  EXPECT_THAT(error_of(explicit_little(kSopClass + kItemEnd)), HasSubstr("stands outside of a sequence"));
  EXPECT_THAT(error_of(explicit_little(longer(0x300A, 0x00B0, "SQ", 16) + kSopClass)),
              HasSubstr("SOPClassUID (0008,0016) at byte 172 stands where an item of a sequence is expected"));
}

// Where DCMTK reads other elements than those that were followed.
TEST(FileStructure, WhatProgramsReadDifferentlyIsRefused) {
  const std::string implicit = shorter(0x0002, 0x0010, "UI", std::string("1.2.840.10008.1.2\0", 18));
  const std::string file = std::string(128, '\0') + "DICM";
  EXPECT_THAT(error_of(file + implicit + shorter(0x0002, 0x0010, "UI", "1.2.840.10008.1.2.1 ") + kSopClass),
              HasSubstr("TransferSyntaxUID (0002,0010) at byte 158 stands where a larger tag is expected"));
  EXPECT_THAT(error_of(file + shorter(0x0002, 0x0000, "UL", little(1000, 4)) + implicit + kSopClass),
              HasSubstr("says that the file meta information ends at byte 1144, and it ends at byte 170"));
  EXPECT_THAT(error_of(std::string("\0\x08\0\x16OB\0\0\0\0\0\x04", 12)), HasSubstr("names no transfer syntax"));
  // DCMTK would take the deflated bytes for elements, and reserve what they announce.
  EXPECT_THAT(error_of(file + shorter(0x0002, 0x0010, "TM", "1.2.840.10008.1.2.1.99") + deflated(kSopClass)),
              HasSubstr("TransferSyntaxUID (0002,0010) at byte 132 has the value representation TM, expected UI"));
}

// The bound holds at any depth.
TEST(FileStructure, ALargeValueInASequenceIsRefused) {
  const TemporaryFolder folder;
  std::ofstream(folder / "a.dcm", std::ios::binary) << explicit_little(
      kSopClass + longer(0x300A, 0x00B0, "SQ", kUndefined) + item(kUndefined) + longer(0x0011, 0x1001, "OB", 1 << 30));
  std::filesystem::resize_file(folder / "a.dcm", 2'000'000'000);
  EXPECT_THAT(error_of([&] { DicomFile::read(folder / "a.dcm", DicomFile::Extent::kHeader); }),
              HasSubstr("a.dcm: has more than 128 MiB besides its pixels"));
}

TEST(FileStructure, PrivateValuesAreNotLookedInto) {
  const std::string value = item(4) + "what";
  EXPECT_EQ(error_of(explicit_little(kSopClass + longer(0x0011, 0x1001, "UN", 14) + item(0xFFFF) + "123456")),
            "no error");
  EXPECT_EQ(error_of(part_10("1.2.840.10008.1.2", tag(0x0011, 0x1001) + little(12, 4) + value)), "no error");
}

TEST(FileStructure, UnknownTransferSyntaxesAreRefused) {
  EXPECT_THAT(error_of(part_10("1.2.840.10008.1.9.9", kSopClass)),
              HasSubstr("X.dcm: TransferSyntaxUID (0002,0010) is 1.2.840.10008.1.9.9, which isoshift does not know"));
}

// Nested without end, sequences would take all of the stack.
std::string nested_without_end() {
  std::string bytes;
  for (int n = 0; n < 100'000; ++n) bytes += longer(0x30FA, 0x00B0, "SQ", kUndefined) + item(kUndefined);
  return bytes;
}

TEST(FileStructure, SequencesNestedWithoutEndAreRefused) {
  const auto is_named = StartsWith("X.dcm: its sequences are nested more than 500 deep");
  EXPECT_THAT(error_of(explicit_little(kSopClass + nested_without_end())), is_named);
  EXPECT_THAT(error_of(kSopClass + nested_without_end()), is_named);  // without file meta information
  EXPECT_THAT(error_of(part_10("1.2.840.10008.1.2.1.99", deflated(kSopClass + nested_without_end()))), is_named);
}

TEST(FileStructure, DeflatedDatasetsAreBounded) {
  const std::string syntax = "1.2.840.10008.1.2.1.99";
  const std::string dataset = deflated(kSopClass);
  EXPECT_EQ(error_of(part_10(syntax, dataset)), "no error");
  EXPECT_EQ(error_of(part_10(syntax, dataset + std::string(1, '\0'))), "no error");  // padding
  EXPECT_THAT(error_of(part_10(syntax, dataset + "more")),
              HasSubstr("X.dcm: its deflated dataset is followed by 4 bytes that are not part of it"));
  EXPECT_THAT(error_of(part_10(syntax, dataset.substr(0, 5))), HasSubstr("X.dcm: its deflated dataset ends too early"));
  EXPECT_THAT(error_of(part_10(syntax, "\xFF" + dataset)), HasSubstr("X.dcm: its deflated dataset is damaged"));
  const std::string bomb = deflated(kSopClass + longer(0x0011, 0x1001, "OB", 65 << 20) + std::string(65 << 20, '\0'));
  EXPECT_LT(bomb.size(), 100'000U);
  EXPECT_THAT(error_of(part_10(syntax, bomb)), HasSubstr("X.dcm: its deflated dataset is larger than 64 MiB"));
}

// A dataset is read in pieces of a mebibyte; those of these files end within values, headers and sequences.
TEST(FileStructure, LargeDatasetsAreReadInPieces) {
  const TemporaryFolder folder;
  for (std::uint32_t ahead = (1 << 20) - 60; ahead < (1 << 20) + 60; ahead += 2) {
    const std::string dataset = kSopClass + longer(0x0011, 0x1001, "OB", ahead) + std::string(ahead, 'x') +
                                longer(0x300A, 0x00B0, "SQ", 20) + item(12) + shorter(0x0010, 0x0010, "PN", "A^B ") +
                                shorter(0x300E, 0x0002, "CS", "APPROVED");
    for (const auto& [name, bytes] : {std::pair(folder / "a.dcm", explicit_little(dataset)),
                                      {folder / "d.dcm", part_10("1.2.840.10008.1.2.1.99", deflated(dataset))}}) {
      std::ofstream(name, std::ios::binary) << bytes;
      for (const DicomFile::Extent extent : {DicomFile::Extent::kHeader, DicomFile::Extent::kWhole}) {
        const DicomFile file = DicomFile::read(name, extent);
        EXPECT_EQ(file.dataset().text(DCM_ApprovalStatus), "APPROVED");
        ASSERT_EQ(file.dataset().items(DCM_BeamSequence).size(), 1U);
        EXPECT_EQ(file.dataset().items(DCM_BeamSequence)[0].text(DCM_PatientName), "A^B");
      }
    }
  }
}

}  // namespace
}  // namespace isoshift::file_structure_test
