// Against the table of the standard, and against an object that has every attribute of the dictionary.

#include "io/objects/deidentification.h"

#include <dcmtk/dcmdata/dctk.h>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "base/text_file.h"
#include "io/dicom/decode.h"
#include "tests/support/small_study.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/testdata.h"

namespace isoshift::deidentification_test {
namespace {

using testing::HasSubstr;
using testing::Not;

struct Row {
  DcmTagKey tag;
  std::string action, name;
  bool may_be_modified = false;  // by the option Retain Longitudinal Temporal Information with Modified Dates
};

std::vector<Row> table_e1_1() {
  std::ifstream file(ISOSHIFT_SOURCE_DIR "/tests/io/objects/basic_profile.csv");
  std::vector<Row> rows;
  for (std::string line; std::getline(file, line);) {
    unsigned group = 0, element = 0;
    if (std::sscanf(line.c_str(), "%4x,%4x;", &group, &element) != 2 || line[4] != ',' || line[9] != ';') continue;
    std::istringstream fields(line.substr(10));
    Row row{.tag = DcmTagKey(static_cast<Uint16>(group), static_cast<Uint16>(element)), .action = {}, .name = {}};
    std::getline(fields, row.action, ';');
    std::getline(fields, row.name, ';');
    row.may_be_modified = line.ends_with(";C");
    rows.push_back(row);
  }
  return rows;
}

// What no file may tell afterwards, as a value of any VR.
std::string telling_value(DcmEVR vr) {
  switch (vr) {
    case EVR_AE:
    case EVR_SH: return "Smith 4711";
    case EVR_AS: return "047Y";
    case EVR_CS: return "SMITH";
    case EVR_DA: return "19570301";
    case EVR_DT: return "19570301101500";
    case EVR_TM: return "101500";
    case EVR_DS:
    case EVR_IS: return "4711";
    case EVR_UI: return "1.2.3.4711";
    default: return "Smith of 4711 Main Street";
  }
}

// Puts the value that tells, in the attribute's own VR; a sequence gets an item with it.
void put_telling(DcmItem& item, const DcmTagKey& key) {
  const DcmTag tag(key);
  switch (tag.getEVR()) {
    case EVR_SQ: {
      DcmItem* inner = nullptr;
      ASSERT_TRUE(item.findOrCreateSequenceItem(tag, inner, 0).good());
      inner->putAndInsertString(DCM_PatientComments, "Smith of 4711 Main Street");
      inner->putAndInsertString(DCM_ReferencedSOPInstanceUID, "1.2.3.4711");
      break;
    }
    case EVR_US:
    case EVR_xs: item.putAndInsertUint16(tag, 4711); break;
    case EVR_SS: item.putAndInsertSint16(tag, 4711); break;
    case EVR_UL: item.putAndInsertUint32(tag, 4711); break;
    case EVR_FD: item.putAndInsertFloat64(tag, 4711); break;
    case EVR_FL: item.putAndInsertFloat32(tag, 4711); break;
    case EVR_OB:
    case EVR_OW:
    case EVR_ox:
    case EVR_UN: item.putAndInsertUint8Array(tag, reinterpret_cast<const Uint8*>("Smith 4711"), 10); break;
    default: item.putAndInsertString(tag, telling_value(tag.getEVR()).c_str());
  }
}

// Whether the value that was put is there, or a part of it.
bool still_tells(const DicomItem& item, const DcmTagKey& tag) {
  if (!item.dcmtk().tagExists(tag)) return false;
  if (DcmTag(tag).getEVR() == EVR_SQ) {
    const std::vector<DicomItem> inner = item.items(tag);
    return !inner.empty() && (inner.front().dcmtk().tagExists(DCM_PatientComments) ||
                              inner.front().text(DCM_ReferencedSOPInstanceUID) == "1.2.3.4711");
  }
  OFString value;
  item.dcmtk().findAndGetOFStringArray(tag, value);
  return value == telling_value(DcmTag(tag).getEVR()).c_str() || value.find("Smith") != OFString_npos;
}

TEST(Deidentification, DoesWhatTableE11Says) {
  const std::vector<Row> rows = table_e1_1();
  ASSERT_GT(rows.size(), 600);
  for (const Row& row : rows) {
    DicomFile file;
    put_telling(file.dataset().dcmtk(), row.tag);
    Pseudonyms pseudonyms;
    const DicomFile safe = deidentified(file, pseudonyms);
    const bool is_there = safe.dataset().dcmtk().tagExists(row.tag);
    if (row.tag == DCM_TimezoneOffsetFromUTC) continue;  // stays, as the option allows: it goes with the times
    if (row.action == "X" && !row.may_be_modified) {
      EXPECT_FALSE(is_there) << row.name;
      continue;
    }
    const bool is_time = DcmTag(row.tag).getEVR() == EVR_TM && row.may_be_modified;
    EXPECT_TRUE(is_time || !still_tells(safe.dataset(), row.tag)) << row.name;
  }
}

TEST(Deidentification, WhatIsNotKnownGoes) {
  DicomFile file;
  DcmItem& dataset = file.dataset().dcmtk();
  dataset.putAndInsertString(DcmTag(0x0009, 0x0010, EVR_LO), "SMITH SYSTEMS");
  dataset.putAndInsertString(DcmTag(0x0009, 0x1001, EVR_LO), "Smith");
  dataset.putAndInsertString(DcmTag(0x0018, 0x0FFE, EVR_CS), "SMITH");  // no attribute of the dictionary
  dataset.putAndInsertString(DcmTag(0x6000, 0x0022, EVR_LO), "Smith");
  dataset.putAndInsertString(DcmTag(0x5000, 0x0022, EVR_LO), "Smith");
  dataset.putAndInsertUint8Array(DcmTag(0x0042, 0x0011, EVR_OB), reinterpret_cast<const Uint8*>("Smith"), 6);
  dataset.putAndInsertString(DCM_SliceThickness, "Smith");      // no number
  dataset.putAndInsertString(DCM_AcquisitionTime, "19570301");  // no time
  dataset.putAndInsertString(DCM_AcquisitionDate, "20260301Smith");
  dataset.putAndInsertString(DCM_FrameOfReferenceUID, "1.2.840.10008.1.4.3.1.Smith");
  dataset.putAndInsertString(DCM_BodyPartExamined, "Smith^J");
  dataset.putAndInsertString(DcmTag(DCM_InstitutionName, EVR_CS), "SMITH");  // under another VR
  dataset.putAndInsertString(DcmTag(DCM_StudyDescription, EVR_UI), "1.2.Smith");
  dataset.putAndInsertString(DcmTag(DCM_PatientName, EVR_CS), "SMITH");
  dataset.putAndInsertString(DCM_ReferencedSOPClassUID, "1.2.Smith");
  Pseudonyms pseudonyms;
  const DicomFile safe = deidentified(file, pseudonyms);
  EXPECT_EQ(safe.dataset().text(DCM_AcquisitionTime).value_or(""), "");
  std::ostringstream printed;
  safe.dataset().dcmtk().print(printed);
  EXPECT_THAT(printed.str(), Not(HasSubstr("mith")));
  EXPECT_THAT(printed.str(), Not(HasSubstr("SMITH")));
}

TEST(Deidentification, KeepsGeometryPixelsAndWhatBelongsTogether) {
  SmallStudy study;
  Pseudonyms pseudonyms;
  DicomFile ct = DicomFile::read(study.ct_slice(1), DicomFile::Extent::kWhole);
  DicomFile before = DicomFile::read(study.ct_slice(1), DicomFile::Extent::kWhole);
  DicomFile image = DicomFile::read(study.image(0), DicomFile::Extent::kWhole);
  DicomFile plan = DicomFile::read(study.plan(), DicomFile::Extent::kWhole);
  for (DicomFile* file : {&ct, &image, &plan}) *file = deidentified(*file, pseudonyms);
  for (const DcmTagKey& tag : {DCM_ImagePositionPatient, DCM_ImageOrientationPatient, DCM_PixelSpacing})
    EXPECT_EQ(ct.dataset().numbers(tag), before.dataset().numbers(tag)) << described(tag);
  for (const DcmTagKey& tag : {DCM_SOPClassUID, DCM_Modality, DCM_PatientPosition, DCM_Manufacturer, DCM_RescaleSlope})
    EXPECT_EQ(ct.dataset().text(tag), before.dataset().text(tag)) << described(tag);
  EXPECT_EQ(ct.dataset().text(DCM_PatientID), image.dataset().text(DCM_PatientID));
  EXPECT_EQ(ct.dataset().text(DCM_FrameOfReferenceUID), plan.dataset().text(DCM_FrameOfReferenceUID));
  EXPECT_NE(ct.dataset().text(DCM_FrameOfReferenceUID), before.dataset().text(DCM_FrameOfReferenceUID));
  EXPECT_EQ(image.dataset().items(DCM_ReferencedRTPlanSequence).at(0).text(DCM_ReferencedSOPInstanceUID),
            plan.dataset().text(DCM_SOPInstanceUID));
  EXPECT_EQ(ct.dataset().text(DCM_PatientIdentityRemoved), "YES");
}

// What stands before the dataset, the file meta information and compressed streams are made anew.
TEST(Deidentification, FilesHoldNothingElse) {
  const SmallStudy study;
  for (const auto& entry : std::filesystem::directory_iterator(testdata("compressed"))) {
    const std::filesystem::path& source = entry.path();
    if (source.extension() != ".dcm") continue;
    const std::filesystem::path spoiled = study.path() / "spoiled.dcm", written = study.path() / "written.dcm";
    std::filesystem::copy_file(source, spoiled);
    std::fstream(spoiled, std::ios::in | std::ios::out | std::ios::binary) << "Smith";
    const DicomFile file = DicomFile::read(spoiled, DicomFile::Extent::kWhole);
    const std::string patient = file.dataset().required_text(DCM_PatientID);
    Pseudonyms pseudonyms;
    deidentified(file, pseudonyms).write(written);
    const DicomFile before = DicomFile::read(spoiled, DicomFile::Extent::kWhole);
    const DicomFile after = DicomFile::read(written, DicomFile::Extent::kWhole);
    EXPECT_FALSE(after.is_compressed()) << source;
    EXPECT_EQ(decode_frame(after, pixel_format(after.dataset()), 0),
              decode_frame(before, pixel_format(before.dataset()), 0))
        << source;
    const std::string bytes = text_of_file(written);
    EXPECT_THAT(bytes, Not(HasSubstr("Smith")));
    EXPECT_THAT(bytes, Not(HasSubstr(patient)));
    std::filesystem::remove(spoiled);
    std::filesystem::remove(written);
  }
}

// Twelve of sixteen bits are used: the others may hold an overlay (of old), or anything.
TEST(Deidentification, UnusedBitsHoldNothing) {
  DicomFile file;
  DicomItem dataset = file.dataset();
  put_pixel_format(dataset, {.columns = 2, .rows = 1, .bits_stored = 12});
  dataset.put_pixels(std::vector<std::uint16_t>{0x5123, 0x8FFF});
  Pseudonyms pseudonyms;
  const DicomFile safe = deidentified(file, pseudonyms);
  const Uint16* words = nullptr;
  ASSERT_TRUE(safe.dataset().dcmtk().findAndGetUint16Array(DCM_PixelData, words).good());
  EXPECT_EQ(words[0], 0x0123);
  EXPECT_EQ(words[1], 0x0FFF);
}

TEST(Deidentification, WhatIsSaidOfARegistrationStays) {
  const std::filesystem::path review = testdata("registrations/review/spatial_registration.dcm");
  Pseudonyms pseudonyms;
  const DicomFile safe = deidentified(DicomFile::read(review, DicomFile::Extent::kWhole), pseudonyms);
  EXPECT_EQ(safe.dataset().text(DCM_ContentDescription), "NOT ACCEPTED: REVIEW");
  EXPECT_EQ(safe.dataset().text(DCM_ContentLabel), "SETUP_REVIEW");
}

}  // namespace
}  // namespace isoshift::deidentification_test
