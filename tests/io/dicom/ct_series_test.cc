#include "io/dicom/ct_series.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "base/error.h"
#include "io/dicom/decode.h"
#include "tests/support/command.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"

namespace isoshift::ct_series_test {
namespace {

// A CT of 8 x 6 pixels whose value at (i, j, k) is 100 k + 10 j + i, changed slice by slice.
class CtSeriesTest : public testing::Test {
 protected:
  static constexpr int kColumns = 8, kRows = 6;

  void write(int k, const Eigen::Vector3d& position, const std::function<void(DicomItem)>& change = {}) {
    DicomFile file;
    DicomItem d = file.dataset();
    d.put(DCM_SOPClassUID, "1.2.840.10008.5.1.4.1.1.2");
    d.put(DCM_SOPInstanceUID, fmt::format("1.2.3.{}", k + 1));
    d.put(DCM_StudyInstanceUID, "1.2");
    d.put(DCM_ImageType, "ORIGINAL\\PRIMARY\\AXIAL");
    d.put(DCM_SeriesInstanceUID, "1.2.3");
    d.put(DCM_FrameOfReferenceUID, "1.2.4");
    d.put(DCM_ImagePositionPatient, std::span(position.data(), 3));
    d.put(DCM_ImageOrientationPatient, "1\\0\\0\\0\\1\\0");
    d.put(DCM_PixelSpacing, "0.5\\0.25");  // rows 0.5 mm apart, columns 0.25 mm
    d.put(DCM_SamplesPerPixel, 1);
    d.put(DCM_Rows, kRows);
    d.put(DCM_Columns, kColumns);
    d.put(DCM_BitsAllocated, 16);
    d.put(DCM_BitsStored, 12);
    d.put(DCM_HighBit, 11);
    d.put(DCM_PixelRepresentation, 0);
    d.put(DCM_RescaleSlope, 2.0);
    d.put(DCM_RescaleIntercept, -1000.0);
    std::vector<std::uint16_t> stored;
    for (int j = 0; j < kRows; ++j)
      for (int i = 0; i < kColumns; ++i) stored.push_back(static_cast<std::uint16_t>(100 * k + 10 * j + i));
    d.put_pixels(stored);
    if (change) change(d);
    // Names in random order: the position counts, not the name.
    const std::filesystem::path path = folder_ / fmt::format("{:02}.dcm", (k * 7) % 23);
    file.write(path);
    files_.push_back(path);
  }

  void write_even(int count, double spacing_mm = 5.0) {
    for (int k = 0; k < count; ++k) write(k, {10, 20, 30 + spacing_mm * k});
  }

  void edit_all(const std::function<void(DicomItem)>& change) {
    for (const std::filesystem::path& path : files_) edit(path, change);
  }

  CtSeries read(const Allowances& allowed = {}) {
    std::ranges::shuffle(files_, std::mt19937(1));
    return read_ct_series(files_, allowed, notes_, {});
  }

  std::string error_of_reading() {
    try {
      read();
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  // The slices written so far as one Enhanced CT: what differs per frame in its own macros, the rest in shared ones.
  void convert_to_enhanced(const std::function<void(DicomItem)>& change = {}) {
    DicomFile file;
    DicomItem d = file.dataset();
    std::vector<std::uint16_t> pixels;
    std::string number = fmt::format("{}", files_.size());
    for (const std::filesystem::path& path : files_) {
      const DicomFile slice = DicomFile::read(path, DicomFile::Extent::kWhole);
      const DicomItem old = slice.dataset();
      DicomItem frame = d.append_item(DCM_PerFrameFunctionalGroupsSequence);
      const auto copy = [&](const DcmTagKey& macro, std::initializer_list<DcmTagKey> tags) {
        DicomItem item = frame.append_item(macro);
        for (const DcmTagKey& tag : tags) item.put(tag, old.numbers(tag));
      };
      copy(DCM_PlanePositionSequence, {DCM_ImagePositionPatient});
      copy(DCM_PixelValueTransformationSequence, {DCM_RescaleSlope, DCM_RescaleIntercept});
      DicomItem content = frame.append_item(DCM_FrameContentSequence);
      content.put(DCM_StackID, "1");
      for (const std::int32_t value : decode_frame(slice, pixel_format(old), 0))
        pixels.push_back(static_cast<std::uint16_t>(value));
    }
    DicomItem shared = d.append_item(DCM_SharedFunctionalGroupsSequence);
    shared.append_item(DCM_PlaneOrientationSequence).put(DCM_ImageOrientationPatient, "1\\0\\0\\0\\1\\0");
    shared.append_item(DCM_PixelMeasuresSequence).put(DCM_PixelSpacing, "0.5\\0.25");
    d.put(DCM_SOPClassUID, "1.2.840.10008.5.1.4.1.1.2.1");
    d.put(DCM_SOPInstanceUID, "1.2.3.99");
    d.put(DCM_ImageType, "ORIGINAL\\PRIMARY\\VOLUME\\NONE");
    d.put(DCM_StudyInstanceUID, "1.2.5");
    d.put(DCM_SeriesInstanceUID, "1.2.3");
    d.put(DCM_FrameOfReferenceUID, "1.2.4");
    d.put(DCM_NumberOfFrames, number);
    put_pixel_format(d, {.columns = kColumns, .rows = kRows, .bits_stored = 12});
    d.put_pixels(pixels);
    if (change) change(d);
    const std::filesystem::path path = folder_ / "enhanced.dcm";
    file.write(path);
    files_ = {path};
  }

  TemporaryFolder folder_;
  std::vector<std::filesystem::path> files_;
  Notes notes_;
};

TEST_F(CtSeriesTest, PutsVoxelsWhereTheStandardSays) {
  write_even(6);
  const CtSeries ct = read();
  EXPECT_EQ(ct.hu.size, Eigen::Vector3i(kColumns, kRows, 6));
  EXPECT_FLOAT_EQ(ct.hu.at(3, 2, 4), 2 * (100 * 4 + 10 * 2 + 3) - 1000);
  // p = IPP + i * column spacing * row direction + j * row spacing * column direction
  EXPECT_THAT(Eigen::Vector3d(ct.hu.patient_from_voxel * Eigen::Vector3d(3, 2, 4)),
              VectorNear(Eigen::Vector3d(10 + 3 * 0.25, 20 + 2 * 0.5, 50), 1e-12));
  EXPECT_THAT(ct.sop_instance_uids,
              testing::ElementsAre("1.2.3.1", "1.2.3.2", "1.2.3.3", "1.2.3.4", "1.2.3.5", "1.2.3.6"));
}

TEST_F(CtSeriesTest, RescalesEverySliceByItsOwnNumbers) {
  write_even(5);
  write(5, {10, 20, 55}, [](DicomItem d) {
    d.put(DCM_RescaleSlope, 1.0);
    d.put(DCM_RescaleIntercept, -900.0);
  });
  EXPECT_FLOAT_EQ(read().hu.at(1, 0, 5), 501 - 900);
}

TEST_F(CtSeriesTest, MasksUnusedBitsAndExtendsTheSign) {
  write_even(5);
  write(5, {10, 20, 55}, [](DicomItem d) {
    d.put(DCM_PixelRepresentation, 1);
    d.put(DCM_RescaleSlope, 1.0);
    d.put(DCM_RescaleIntercept, 0.0);
    d.put_pixels(std::vector<std::uint16_t>(kColumns * kRows, 0xFF38));  // twelve bits: -200; the rest an old overlay
  });
  EXPECT_FLOAT_EQ(read().hu.at(0, 0, 5), -200);
}

TEST_F(CtSeriesTest, PaddingAndWhatIsBelowAirBecomeAir) {
  write_even(5);
  write(5, {10, 20, 55}, [](DicomItem d) {
    d.put(DCM_PixelPaddingValue, 503.0);
    d.put(DCM_RescaleIntercept, -2010.0);
  });
  const CtSeries ct = read();
  EXPECT_EQ(ct.hu.at(3, 0, 5), -1000);  // padding
  EXPECT_EQ(ct.hu.at(4, 0, 5), -1000);  // 504 * 2 - 2010 is below air
  EXPECT_EQ(ct.hu.at(6, 0, 5), -998);
}

TEST_F(CtSeriesTest, ReadsSlicesFromFeetToHeadToo) {
  for (int k = 0; k < 6; ++k)
    write(k, {10, 20, 55 - 5.0 * k}, [](DicomItem d) { d.put(DCM_ImageOrientationPatient, "1\\0\\0\\0\\-1\\0"); });
  const CtSeries ct = read();
  // The normal points to the feet: the first slice along it is the uppermost.
  EXPECT_THAT(Eigen::Vector3d(ct.hu.patient_from_voxel * Eigen::Vector3d(0, 2, 1)),
              VectorNear(Eigen::Vector3d(10, 19, 50), 1e-12));
}

TEST_F(CtSeriesTest, ShearsTheLatticeOfATiltedGantry) {
  for (int k = 0; k < 6; ++k) write(k, {10, 20 + 1.0 * k, 30 + 5.0 * k});
  const CtSeries ct = read();
  EXPECT_THAT(Eigen::Vector3d(ct.hu.patient_from_voxel * Eigen::Vector3d(0, 0, 5)),
              VectorNear(Eigen::Vector3d(10, 25, 55), 1e-12));
  EXPECT_NEAR(ct.hu.patient_from_voxel.linear().col(2).y(), 1.0, 1e-12);
}

TEST_F(CtSeriesTest, TheSameSliceTwiceCountsOnce) {
  write_even(6);
  std::filesystem::copy(files_[2], folder_ / "again.dcm");
  files_.push_back(folder_ / "again.dcm");
  EXPECT_EQ(read().hu.size.z(), 6);
  EXPECT_THAT(notes_.warnings, testing::ElementsAre(testing::HasSubstr("counted once")));
}

TEST_F(CtSeriesTest, AnInstanceInTwoPlacesIsRefused) {
  write_even(6);
  edit(files_[4], [](DicomItem d) { d.put(DCM_SOPInstanceUID, "1.2.3.2"); });
  EXPECT_THAT(error_of_reading(), testing::AllOf(testing::StartsWith(files_[4].string()),
                                                 testing::HasSubstr("has the SOPInstanceUID (0008,0018) of"),
                                                 testing::HasSubstr("but lies elsewhere")));
}

TEST_F(CtSeriesTest, TwoSlicesInOnePlaceAreRefused) {
  write_even(6);
  write(9, {10, 20, 40});
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("One series must hold one slice per position"));
}

TEST_F(CtSeriesTest, AllowedGapsAreInterpolated) {
  for (const int k : {0, 1, 2, 4, 5}) write(k, {10, 20, 30 + 5.0 * k});
  const CtSeries ct = read({{"gaps", "repaired by hand"}});
  EXPECT_EQ(ct.hu.size.z(), 6);
  EXPECT_NEAR(ct.hu.at(0, 0, 3), 2 * 300 - 1000, 1e-3);  // halfway between 200 and 400
  EXPECT_THAT(notes_.overrides, testing::ElementsAre(testing::HasSubstr("(allowed by gaps: repaired by hand)")));
}

// CT-2.
TEST_F(CtSeriesTest, RefusesWhatWouldMisplaceVoxels) {
  write_even(6);
  const std::filesystem::path changed = files_[3];
  const std::map<std::string, std::pair<DcmTagKey, std::string>> wrong = {
      {"PixelSpacing (0028,0030)", {DCM_PixelSpacing, "0.5\\0.26"}},
      {"ImageOrientationPatient (0020,0037)", {DCM_ImageOrientationPatient, "1\\0\\0\\0\\0.999\\0.0447"}},
      {"FrameOfReferenceUID (0020,0052)", {DCM_FrameOfReferenceUID, "1.2.5"}},
      {"StudyInstanceUID (0020,000D)", {DCM_StudyInstanceUID, "1.2.6"}}};
  for (const auto& [name, tag_and_value] : wrong) {
    const auto& [tag, value] = tag_and_value;
    std::string right;
    edit(changed, [&](DicomItem d) {
      right = *d.raw_text(tag);
      d.put(tag, value);
    });
    EXPECT_THAT(error_of_reading(), testing::HasSubstr(name + " differs from that of"));
    edit(changed, [&](DicomItem d) { d.put(tag, right); });
  }
  EXPECT_EQ(error_of_reading(), "no error");
}

TEST_F(CtSeriesTest, RefusesSlicesOfAnotherSize) {
  write_even(6);
  edit(files_[3], [](DicomItem d) {
    d.put(DCM_Columns, kRows);
    d.put(DCM_Rows, kColumns);
  });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("Columns (0028,0011) differs from that of"));
}

// CT-4.
TEST_F(CtSeriesTest, RefusesAxesThatAreNotPerpendicular) {
  write_even(6);
  for (const std::filesystem::path& file : files_)
    edit(file, [](DicomItem d) { d.put(DCM_ImageOrientationPatient, "1\\0\\0\\0.1\\0.995\\0"); });
  EXPECT_THAT(error_of_reading(),
              testing::HasSubstr("ImageOrientationPatient (0020,0037) is not a pair of perpendicular unit vectors"));
}

TEST_F(CtSeriesTest, SlicesOfAnotherPatientAreRefused) {
  write_even(6);
  edit(files_[3], [](DicomItem d) { d.put(DCM_PatientName, "Somebody^Else"); });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("PatientName (0010,0010) differs from that of"));
}

TEST_F(CtSeriesTest, RefusesAStackThatLeavesItsLine) {
  write_even(5);
  write(5, {10, 20, 55});
  edit(files_[2], [](DicomItem d) { d.put(DCM_ImagePositionPatient, "10\\20.3\\40"); });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("lies 0.30 mm beside the line"));
}

TEST_F(CtSeriesTest, RefusesAMissingFrameOfReference) {
  write_even(6);
  edit(files_[0], [](DicomItem d) { d.erase(DCM_FrameOfReferenceUID); });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("FrameOfReferenceUID (0020,0052) is missing"));
}

TEST_F(CtSeriesTest, RefusesUnitsThatAreNotHu) {
  write_even(6);
  edit(files_[3], [](DicomItem d) { d.put(DCM_RescaleType, "US"); });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("RescaleType (0028,1054) is US, expected HU"));
}

TEST_F(CtSeriesTest, RefusesAnotherModalityAndTwoPositions) {
  write_even(6);
  edit(files_[2], [](DicomItem d) { d.put(DCM_Modality, "MR"); });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("Modality (0008,0060) is MR, expected CT"));
  edit_all([](DicomItem d) {
    d.put(DCM_Modality, "CT");
    d.put(DCM_PatientPosition, "HFS");
  });
  edit(files_[3], [](DicomItem d) { d.put(DCM_PatientPosition, "FFS"); });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("PatientPosition (0018,5100) differs from that of"));
}

TEST_F(CtSeriesTest, RefusesPixelDataThatIsTooShort) {
  write_even(6);
  edit(files_[3], [](DicomItem d) { d.put_pixels(std::vector<std::uint16_t>(10)); });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("PixelData (7FE0,0010) holds 10 pixels, expected 8 x 6"));
}

TEST_F(CtSeriesTest, AnEnhancedCtIsTheSameVolumeAsItsSlices) {
  for (int k = 0; k < 6; ++k)
    write(k, {10, 20, 30 + 5.0 * k}, [&](DicomItem d) { d.put(DCM_RescaleIntercept, -1000.0 - k); });
  const CtSeries slices = read();
  convert_to_enhanced();
  const CtSeries enhanced = read();
  EXPECT_EQ(enhanced.hu.voxels, slices.hu.voxels);
  EXPECT_TRUE(enhanced.hu.patient_from_voxel.isApprox(slices.hu.patient_from_voxel, 1e-12));
  EXPECT_THAT(enhanced.sop_instance_uids, testing::ElementsAre("1.2.3.99"));
}

TEST_F(CtSeriesTest, AnEnhancedCtMayBeCompressed) {
  write_even(6);
  convert_to_enhanced();
  const std::vector<float> voxels = read().hu.voxels;
  const std::filesystem::path plain = files_.front();
  for (const std::string command : {"dcmcrle", "dcmcjpls +el", "dcmcjpeg +e1", "dcmconv +td"}) {
    files_ = {folder_ / (command.substr(0, command.find(' ')) + ".dcm")};
    ASSERT_EQ(run_shell(fmt::format("{} {} {}", command, plain.string(), files_.front().string())).exit_status, 0)
        << command;
    EXPECT_EQ(read().hu.voxels, voxels) << command;
  }
}

TEST_F(CtSeriesTest, OfSeveralStacksNoneIsChosen) {
  write_even(6);
  convert_to_enhanced([](DicomItem d) {
    for (DicomItem& frame : d.items(DCM_PerFrameFunctionalGroupsSequence)) {
      static int number = 0;
      frame.items(DCM_FrameContentSequence).front().put(DCM_StackID, ++number > 3 ? "2" : "1");
    }
  });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("holds 2 volumes (stack 1 at time 1, stack 2 at time 1)"));
}

TEST_F(CtSeriesTest, ALocalizerAmongTheFramesIsRefused) {
  write_even(6);
  convert_to_enhanced([](DicomItem d) {
    DicomItem frame = d.items(DCM_PerFrameFunctionalGroupsSequence)[2];
    frame.append_item(DCM_CTImageFrameTypeSequence).put(DCM_FrameType, "ORIGINAL\\PRIMARY\\LOCALIZER\\NONE");
  });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("frame 3: FrameType (0008,9007) says LOCALIZER"));
}

TEST_F(CtSeriesTest, PartOfAConcatenationIsRefused) {
  write_even(6);
  convert_to_enhanced([](DicomItem d) {
    d.put(DCM_ConcatenationUID, "1.2.5");
    d.put(DCM_InConcatenationTotalNumber, 2);
  });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("is part of a concatenation (ConcatenationUID (0020,9161))"));
}

TEST_F(CtSeriesTest, AFrameWithoutItsMacroIsNamed) {
  write_even(6);
  convert_to_enhanced(
      [](DicomItem d) { d.items(DCM_PerFrameFunctionalGroupsSequence)[2].erase(DCM_PlanePositionSequence); });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("frame 3: PlanePositionSequence (0020,9113) is missing"));
}

TEST_F(CtSeriesTest, MoreFramesThanItemsAreRefused) {
  write_even(6);
  convert_to_enhanced([](DicomItem d) { d.put(DCM_NumberOfFrames, "7"); });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("has 6 items, expected one for each of 7 frames"));
}

TEST_F(CtSeriesTest, AStackThatIsNoBodyIsRefused) {
  write_even(4);
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("its slices span 15.0 mm, expected 20 to 2500 mm"));
}

// What would make an invalid object of everything that is written of this CT (PS3.5 6.2).
TEST_F(CtSeriesTest, APatientWhomNoObjectCanNameIsRefused) {
  write_even(6);
  edit_all([](DicomItem d) { d.put(DCM_PatientName, std::string(64, 'A') + "=" + std::string(64, 'B')); });
  EXPECT_EQ(read().identity.patient_name.size(), 129U);  // each group of a name counts by itself
  edit_all([](DicomItem d) { d.put(DCM_PatientName, std::string(65, 'A')); });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("PatientName (0010,0010) is longer than the 64 characters"));
  edit_all([](DicomItem d) {
    d.put(DCM_PatientName, "A");
    d.put(DCM_PatientID, std::string(65, '1'));
  });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("PatientID (0010,0020) is longer than the 64 characters"));
}

TEST_F(CtSeriesTest, WhatDicomDoesNotAllowIsLeftOutOfWhatIsWritten) {
  write_even(6);
  edit_all([](DicomItem d) {
    d.put(DCM_AccessionNumber, "12345678901234567");
    d.put(DCM_StudyDate, "2026.03.01");
    d.put(DCM_StudyID, "1234567890123456");
  });
  const Identity identity = read().identity;
  EXPECT_EQ(identity.accession_number, "");
  EXPECT_EQ(identity.study_date, "");
  EXPECT_EQ(identity.study_id, "1234567890123456");
  EXPECT_THAT(notes_.warnings,
              testing::UnorderedElementsAre(testing::HasSubstr("AccessionNumber (0008,0050) is not as DICOM allows"),
                                            testing::HasSubstr("StudyDate (0008,0020) is not as DICOM allows")));
}

TEST_F(CtSeriesTest, ACtOfNoStudyIsRefused) {
  write_even(6);
  edit_all([](DicomItem d) { d.erase(DCM_StudyInstanceUID); });
  EXPECT_THAT(error_of_reading(), testing::HasSubstr("StudyInstanceUID (0020,000D) is missing"));
}

TEST_F(CtSeriesTest, NumbersThatNoScannerWritesAreInDoubt) {
  write_even(6);
  edit(files_[3], [](DicomItem d) { d.put(DCM_RescaleSlope, 1000.0); });
  EXPECT_THAT(read().doubts, testing::ElementsAre(testing::HasSubstr("voxels of the CT have more than 32767 HU")));
  edit_all([](DicomItem d) { d.put(DCM_RescaleSlope, 10.0); });
  EXPECT_THAT(read().doubts, testing::IsEmpty());
  edit_all([](DicomItem d) {
    d.put(DCM_RescaleSlope, 1.0);
    d.put_pixels(std::vector<std::uint16_t>(kColumns * kRows, 0));
  });
  EXPECT_THAT(read().doubts, testing::IsEmpty());
  edit(files_[2], [](DicomItem d) {
    std::vector<std::uint16_t> pixels(kColumns * kRows, 0);
    pixels[1] = pixels[2] = 3500;  // 2500 HU: may be bone
    d.put_pixels(pixels);
  });
  EXPECT_THAT(read().doubts, testing::IsEmpty());
  edit(files_[2], [](DicomItem d) {
    d.put(DCM_RescaleIntercept, -1000.0);
    d.put(DCM_BitsStored, 16);
    d.put(DCM_HighBit, 15);
    std::vector<std::uint16_t> pixels(kColumns * kRows, 0);
    pixels[1] = pixels[2] = 9000;
    d.put_pixels(pixels);
  });
  EXPECT_THAT(read().doubts, testing::ElementsAre(
                                 testing::HasSubstr("2 voxels of the CT have more than 4000 HU in the midst of air")));
}

TEST_F(CtSeriesTest, AProjectionOfSeveralPhasesIsWarnedOf) {
  write_even(6);
  edit_all([](DicomItem d) { d.put(DCM_ImageType, "DERIVED\\SECONDARY\\MIP"); });
  read();
  EXPECT_THAT(notes_.warnings, testing::ElementsAre(testing::HasSubstr("ImageType (0008,0008) says MIP")));
}

TEST_F(CtSeriesTest, ASliceThatDoesNotSayWhatItIsIsWarnedOf) {
  write_even(6);
  edit_all([](DicomItem d) { d.put(DCM_ImageType, "ORIGINAL\\PRIMARY"); });
  read();
  EXPECT_THAT(notes_.warnings, testing::ElementsAre(testing::HasSubstr("ImageType (0008,0008) has 2 values")));
}

TEST_F(CtSeriesTest, CompressionWithLossIsWarnedOf) {
  write_even(6);
  edit(files_[3], [](DicomItem d) { d.put(DCM_LossyImageCompression, "01"); });
  read();
  EXPECT_THAT(notes_.warnings, testing::ElementsAre(testing::HasSubstr("compressed with loss")));
}

}  // namespace
}  // namespace isoshift::ct_series_test
