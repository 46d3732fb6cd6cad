#include "io/dicom/dicom_dataset.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <charconv>
#include <cmath>
#include <fstream>
#include <random>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::dicom_dataset_test {
namespace {

double parsed(const std::string& text) {
  double value = NAN;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

TEST(DicomDataset, DecimalStringsAreShortenedAndNeverCut) {
  EXPECT_EQ(ds_from(0.0), "0");
  EXPECT_EQ(ds_from(1.0), "1");
  EXPECT_EQ(ds_from(-0.5), "-0.5");
  EXPECT_EQ(ds_from(3e-13), "0");
  // The trap of docs/dicom.md 4.4: cut to 16 characters, this one would lose its exponent's digit.
  EXPECT_EQ(ds_from(-4.909883469673e-05), "-4.90988347e-05");
}

TEST(DicomDataset, DecimalStringsFitAndReadBack) {
  std::mt19937_64 random(5);
  for (int n = 0; n < 100000; ++n) {
    const double value =
        std::ldexp(std::uniform_real_distribution<double>(-1, 1)(random), static_cast<int>(random() % 40) - 20);
    const std::string text = ds_from(value);
    ASSERT_LE(text.size(), 16U) << text;
    ASSERT_NEAR(parsed(text), value, std::max(1e-12, std::abs(value) * 5e-10)) << text;
  }
}

TEST(DicomDataset, UidsAreValidAndDiffer) {
  const std::string uid = new_uid();
  EXPECT_THAT(uid, testing::MatchesRegex("2\\.25\\.[1-9][0-9]*"));
  EXPECT_LE(uid.size(), 64U);
  EXPECT_NE(uid, new_uid());
  // All bits set but those of version 4 and variant 1: ffffffff-ffff-4fff-bfff-ffffffffffff.
  std::array<std::uint8_t, 16> ones;
  ones.fill(0xFF);
  EXPECT_EQ(uid_from_random_bytes(ones), "2.25.340282366920937632322261936355783213055");
}

TEST(DicomDataset, EmptyIsAbsent) {
  DicomFile file;
  DicomItem dataset = file.dataset();
  dataset.put(DCM_RTImagePosition, "");
  EXPECT_TRUE(dataset.numbers(DCM_RTImagePosition).empty());
  EXPECT_EQ(dataset.number(DCM_RTImagePosition), std::nullopt);
  EXPECT_EQ(dataset.text(DCM_PatientID), std::nullopt);
}

TEST(DicomDataset, NumbersThatAreNoneAreNamed) {
  DicomFile file;
  DicomItem dataset = file.dataset();
  dataset.put(DCM_RadiationMachineSAD, "1000mm");
  try {
    dataset.number(DCM_RadiationMachineSAD);
    FAIL();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(),
                 "new DICOM object: RadiationMachineSAD (3002,0022) holds \"1000mm\", which is not a finite number");
  }
}

TEST(DicomDataset, RequiredValuesAreCounted) {
  DicomFile file;
  DicomItem dataset = file.dataset();
  EXPECT_THROW(dataset.required_numbers(DCM_ImagePositionPatient, 3), Error);
  dataset.put(DCM_ImagePositionPatient, "1\\2");
  EXPECT_THROW(dataset.required_numbers(DCM_ImagePositionPatient, 3), Error);
  dataset.put(DCM_ImagePositionPatient, "1 \\ 2.5e0\\+3");
  EXPECT_THAT(dataset.required_numbers(DCM_ImagePositionPatient, 3), testing::ElementsAre(1.0, 2.5, 3.0));
}

TEST(DicomDataset, FloatsAndShortsAreNumbersToo) {
  DicomFile file;
  DicomItem dataset = file.dataset();
  dataset.put(DCM_TableTopPitchAngle, 359.5);
  dataset.put(DCM_PixelIntensityRelationshipSign, -1.0);
  EXPECT_DOUBLE_EQ(dataset.number(DCM_TableTopPitchAngle).value(), 359.5);
  EXPECT_DOUBLE_EQ(dataset.number(DCM_PixelIntensityRelationshipSign).value(), -1.0);
}

TEST(DicomDataset, TruncatedFilesAreNamed) {
  TemporaryFolder folder;
  std::ofstream(folder / "broken.dcm") << std::string(128, '\0') << "DICM\x02\x00\x10\x00UI\xFF\xFF";
  try {
    DicomFile::read(folder / "broken.dcm", DicomFile::Extent::kWhole);
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("broken.dcm: ends before what its elements announce"));
  }
}

}  // namespace
}  // namespace isoshift::dicom_dataset_test
