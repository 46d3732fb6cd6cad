// Every decoder against the same pixels uncompressed; the compressed copies are made by DCMTK's and GDCM's tools.

#include "io/dicom/decode.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>

#include "base/error.h"
#include "base/output_folder.h"
#include "base/text_file.h"
#include "io/dicom/decoder_process.h"
#include "io/dicom/jpeg2000.h"
#include "tests/support/command.h"
#include "tests/support/small_study.h"
#include "tests/support/testdata.h"

namespace isoshift::decode_test {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

class DecodeTest : public testing::Test {
 protected:
  std::vector<std::int32_t> pixels_of(const std::filesystem::path& path) {
    const DicomFile file = DicomFile::read(path, DicomFile::Extent::kWhole);
    return decode_frame(file, pixel_format(file.dataset()), 0);
  }

  // The slice compressed by `command`, to which source and target are appended.
  std::filesystem::path compressed_by(const std::string& command) {
    const std::filesystem::path target = study_.path() / "compressed.dcm";
    const CommandOutcome made =
        run_shell(fmt::format("{} {} {}", command, study_.ct_slice(18).string(), target.string()));
    EXPECT_EQ(made.exit_status, 0) << made.out;
    return target;
  }

  SmallStudy study_;
};

TEST_F(DecodeTest, LosslessSyntaxesGiveTheSamePixels) {
  const std::vector<std::int32_t> expected = pixels_of(study_.ct_slice(18));
  EXPECT_GT(*std::ranges::max_element(expected), 500);  // there is bone in it
  for (const char* command :
       {"dcmcrle", "dcmcjpeg +e1", "dcmcjpeg +el", "dcmcjpls +el", "dcmconv +td", "dcmconv +ti", "dcmconv +tb"}) {
    EXPECT_EQ(pixels_of(compressed_by(command)), expected) << command;
    std::filesystem::remove(study_.path() / "compressed.dcm");
  }
}

TEST_F(DecodeTest, BaselineJpegGivesNearlyTheSamePixels) {
  // Baseline holds 8 bits: an image of 8 bits, and a lossy one.
  edit(study_.ct_slice(18), [](DicomItem d) {
    std::vector<std::uint16_t> ramp;
    const auto columns = static_cast<int>(d.required_number(DCM_Columns));
    for (int row = 0; row < d.required_number(DCM_Rows); ++row)
      for (int column = 0; column < columns; ++column)
        ramp.push_back(static_cast<std::uint16_t>(40 + 2 * column + row));
    d.put(DCM_BitsStored, 8);
    d.put(DCM_HighBit, 7);
    d.put(DCM_PixelRepresentation, 0);
    d.put_pixels(ramp);
  });
  const std::vector<std::int32_t> expected = pixels_of(study_.ct_slice(18));
  const std::vector<std::int32_t> found = pixels_of(compressed_by("dcmcjpeg +eb +q 100"));
  ASSERT_EQ(found.size(), expected.size());
  // dcmcjpeg stretches the values to its 8 bits; what counts is that the ramp is still one.
  double sum_xy = 0, sum_x = 0, sum_y = 0, sum_xx = 0, sum_yy = 0;
  const auto n = static_cast<double>(found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    sum_x += expected[i], sum_y += found[i], sum_xy += static_cast<double>(expected[i]) * found[i];
    sum_xx += static_cast<double>(expected[i]) * expected[i], sum_yy += static_cast<double>(found[i]) * found[i];
  }
  const double correlation =
      (sum_xy - sum_x * sum_y / n) / std::sqrt((sum_xx - sum_x * sum_x / n) * (sum_yy - sum_y * sum_y / n));
  EXPECT_GT(correlation, 0.9999);
}

TEST_F(DecodeTest, Jpeg2000MayLoseSomethingOrNothing) {
  const std::vector<std::int32_t> expected = pixels_of(study_.ct_slice(18));
  EXPECT_EQ(pixels_of(compressed_by("gdcmconv --j2k")), expected);
  std::filesystem::remove(study_.path() / "compressed.dcm");
  const std::vector<std::int32_t> lossy = pixels_of(compressed_by("gdcmconv --j2k --lossy -q 90"));
  ASSERT_EQ(lossy.size(), expected.size());
  EXPECT_NE(lossy, expected);
  double squares = 0.0;
  for (std::size_t n = 0; n < lossy.size(); ++n) squares += std::pow(lossy[n] - expected[n], 2);
  EXPECT_LT(std::sqrt(squares / static_cast<double>(lossy.size())), 4.0);  // 90 dB of 65536 values: 2.1
}

// As for the other decoders: what the stream says counts, too.
TEST_F(DecodeTest, Jpeg2000OfAnotherImageThanTheHeaderIsRefused) {
  const auto error_with = [&](const DcmTagKey& tag, double value) {
    std::filesystem::remove(study_.path() / "compressed.dcm");
    const std::filesystem::path compressed = compressed_by("gdcmconv --j2k");
    DicomFile file = DicomFile::read(compressed, DicomFile::Extent::kWhole);
    file.dataset().put(tag, value);
    try {
      decompressed_frame(file, 0);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("no error");
  };
  EXPECT_THAT(error_with(DCM_Rows, 47), HasSubstr("Rows (0028,0010) say"));
  EXPECT_THAT(error_with(DCM_PixelRepresentation, 0),
              HasSubstr("its compressed pixels are signed, PixelRepresentation (0028,0103) says unsigned"));
}

// The JPEG 2000 stream of a file with one frame.
std::vector<std::uint8_t> stream_of(const std::filesystem::path& compressed) {
  const std::string bytes = text_of_file(compressed);
  constexpr std::size_t kDelimiter = 8;  // behind the fragments
  const std::size_t begin = bytes.find("\xFF\x4F\xFF\x51");
  return {bytes.begin() + static_cast<std::ptrdiff_t>(begin), bytes.end() - kDelimiter};
}

// OpenJPEG would take the other tile for zeros.
TEST_F(DecodeTest, Jpeg2000WithoutOneOfItsTilesIsRefused) {
  const std::filesystem::path compressed = compressed_by("gdcmconv --j2k");
  const PixelFormat format = pixel_format(DicomFile::read(compressed, DicomFile::Extent::kHeader).dataset());
  std::vector<std::uint8_t> stream = stream_of(compressed);
  // Of tiles half as wide there are two (ISO/IEC 15444-1, A.5.1).
  constexpr std::size_t kLastByteOfTileWidth = 27;
  ASSERT_EQ(stream[kLastByteOfTileWidth], format.columns);
  stream[kLastByteOfTileWidth] = static_cast<std::uint8_t>(format.columns / 2);
  try {
    decoded_jpeg2000(stream, format, "here");
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "here: 1 of its 2 JPEG 2000 tiles are there");
  }
}

TEST_F(DecodeTest, Jpeg2000ThatIsCutOffIsRefused) {
  const std::filesystem::path compressed = compressed_by("gdcmconv --j2k");
  const PixelFormat format = pixel_format(DicomFile::read(compressed, DicomFile::Extent::kHeader).dataset());
  const std::vector<std::uint8_t> stream = stream_of(compressed);
  EXPECT_NO_THROW(decoded_jpeg2000(stream, format, "here"));
  for (const std::size_t left : {std::size_t{0}, std::size_t{3}, std::size_t{60}, stream.size() / 2})
    EXPECT_THROW(decoded_jpeg2000(std::span(stream).first(left), format, "here"), Error) << left;
}

TEST_F(DecodeTest, HighThroughputJpeg2000IsNamed) {
  const std::filesystem::path compressed = compressed_by("gdcmconv --j2k");
  std::string bytes = text_of_file(compressed);
  const std::string_view jpeg2000("1.2.840.10008.1.2.4.90");
  bytes.replace(bytes.find(jpeg2000), jpeg2000.size(), "1.2.840.10008.1.2.4.20");
  // A digit more, and the byte that makes the length even: the UID and the group around it are longer.
  const std::size_t at = bytes.find("1.2.840.10008.1.2.4.20");
  bytes.insert(at + jpeg2000.size(), std::string("1\0", 2));
  constexpr std::size_t kGroupLength = 140;
  for (const std::size_t length : {at - 2, kGroupLength}) bytes[length] = static_cast<char>(bytes[length] + 2);
  const std::filesystem::path named = study_.path() / "named.dcm";
  write_text(named, bytes);
  try {
    pixels_of(named);
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()),
              fmt::format("{}: TransferSyntaxUID (0002,0010) is 1.2.840.10008.1.2.4.201, High-Throughput JPEG 2000, "
                          "which isoshift does not decode.\n       Export the images again, uncompressed or with JPEG "
                          "2000, JPEG-LS, JPEG or RLE",
                          named.string()));
  }
}

TEST_F(DecodeTest, FormatsThatAreNoneAreNamed) {
  const auto error_of = [&](const DcmTagKey& tag, double value) -> std::string {
    edit(study_.ct_slice(1), [&](DicomItem d) { d.put(tag, value); });
    try {
      pixels_of(study_.ct_slice(1));
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_THAT(error_of(DCM_PixelRepresentation, 2),
              HasSubstr("PixelRepresentation (0028,0103) is 2, expected 0 (unsigned) or 1 (signed)"));
  EXPECT_THAT(error_of(DCM_HighBit, 12), HasSubstr("HighBit (0028,0102) is 12, expected 15"));
  EXPECT_THAT(error_of(DCM_SamplesPerPixel, 3), HasSubstr("SamplesPerPixel (0028,0002) is 3, expected 1"));
  edit(study_.ct_slice(1), [&](DicomItem d) { d.put(DCM_SamplesPerPixel, 1); });
  EXPECT_THAT(error_of(DCM_Rows, 9000), HasSubstr("Rows (0028,0010) is 9000, expected 1 to 8192"));
}

TEST_F(DecodeTest, NumbersOfColorsAreNoIntensities) {
  edit(study_.ct_slice(1), [](DicomItem d) { d.put(DCM_PhotometricInterpretation, "PALETTE COLOR"); });
  try {
    pixels_of(study_.ct_slice(1));
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                HasSubstr("PhotometricInterpretation (0028,0004) is PALETTE COLOR, expected MONOCHROME2"));
  }
}

// Other programs in the decoder's place, as a hostile file may make of it.
class DecoderThatFailsTest : public DecodeTest {
 protected:
  ~DecoderThatFailsTest() override { use_decoder(decoder_of(ISOSHIFT_PROGRAM)); }

  std::string error_with_decoder(const std::string& script) {
    const std::filesystem::path program = study_.path() / "decoder";
    std::filesystem::remove(program);
    write_text(program, "#!/bin/sh\n" + script + "\n");
    std::filesystem::permissions(program, std::filesystem::perms::owner_all);
    use_decoder(program);
    try {
      frame_from_decoder(DicomFile::read(compressed_, DicomFile::Extent::kWhole), 0, 1);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  std::filesystem::path compressed_ = compressed_by("dcmcjpls +el");
};

// What is decoded is what was hashed and whose header was read.
TEST_F(DecodeTest, AFileThatChangesBeforeItsPixelsAreDecodedIsRefused) {
  const std::filesystem::path path = compressed_by("dcmcjpls +el");
  const DicomFile file = DicomFile::read(path, DicomFile::Extent::kWhole);
  std::fstream(path, std::ios::in | std::ios::out | std::ios::binary).put('x');  // of the preamble
  try {
    decode_frame(file, pixel_format(file.dataset()), 0);
    FAIL() << "decoded";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("was changed while it was read"));
  }
}

TEST_F(DecoderThatFailsTest, OneThatDiesIsAnErrorThatNamesTheFile) {
  EXPECT_THAT(error_with_decoder("kill -SEGV $$"),
              testing::AllOf(testing::StartsWith(compressed_.string()), HasSubstr("the decoder ended with signal 11")));
  EXPECT_THAT(error_with_decoder("exit 3"), HasSubstr("the decoder ended with status 3"));
}

TEST_F(DecoderThatFailsTest, OneThatStallsIsEnded) {
  EXPECT_THAT(error_with_decoder("exec sleep 60"), HasSubstr("were not decoded within 30 s"));
}

TEST_F(DecoderThatFailsTest, AnAnswerOfAnotherLengthIsRefused) {
  EXPECT_THAT(error_with_decoder("echo '{\"bytes\": 1099511627776}'; exec sleep 5"),
              HasSubstr("was decoded to 1099511627776 bytes, expected 1"));
}

TEST_F(DecoderThatFailsTest, AnAnswerThatIsNoneIsRefused) {
  const auto names_file_and = [&](const std::string& text) {
    return testing::AllOf(testing::StartsWith(compressed_.string()), HasSubstr(text));
  };
  EXPECT_THAT(error_with_decoder("echo hello; exec sleep 5"), names_file_and("the answer of the decoder: is not JSON"));
  EXPECT_THAT(error_with_decoder("echo '{\"bytes\": 1, \"rows\": 1}'; exec sleep 5"),
              names_file_and("the answer of the decoder: there is no key rows"));
  EXPECT_THAT(error_with_decoder("exec cat /dev/zero"),
              names_file_and("the decoder sent a line of more than 24640 bytes"));
}

// What the stream says of its size counts, not only what the header says.
TEST_F(DecodeTest, AStreamOfAnotherSizeThanTheHeaderIsRefused) {
  for (const char* command : {"dcmcjpeg +e1", "dcmcjpls +el"}) {
    const std::filesystem::path compressed = compressed_by(command);
    std::string bytes = text_of_file(compressed);
    std::filesystem::remove(compressed);
    const auto multiply = [&](std::string_view element, double factor) {
      const std::size_t at = bytes.find(element) + element.size();
      std::uint16_t value = 0;
      std::memcpy(&value, bytes.data() + at, 2);
      value = static_cast<std::uint16_t>(value * factor);
      std::memcpy(bytes.data() + at, &value, 2);
    };
    multiply({"\x28\x00\x10\x00US\x02\x00", 8}, 0.5);  // Rows
    multiply({"\x28\x00\x11\x00US\x02\x00", 8}, 2.0);  // Columns
    write_text(compressed, bytes);
    EXPECT_THROW(
        {
          try {
            pixels_of(compressed);
          } catch (const Error& error) {
            EXPECT_THAT(error.what(), HasSubstr("Rows (0028,0010) say"));
            throw;
          }
        },
        Error)
        << command;
  }
}

// OpenJPEG would reserve 10 KB for each tile, 394 MB for those of an image that is not that of the header.
TEST_F(DecodeTest, Jpeg2000OfManyTilesIsRefused) {
  const std::filesystem::path compressed = compressed_by("gdcmconv --j2k");
  const PixelFormat format = pixel_format(DicomFile::read(compressed, DicomFile::Extent::kHeader).dataset());
  const std::vector<std::uint8_t> stream = stream_of(compressed);
  constexpr std::size_t kFirstByteOfRows = 12, kSecondByteOfRows = 13;
  std::vector<std::uint8_t> larger = stream, of_many_tiles = stream;
  larger[kSecondByteOfRows] = 0x24;
  EXPECT_THAT([&] { decoded_jpeg2000(larger, format, "here"); },
              ThrowsMessage<Error>(HasSubstr("its compressed pixels are 48 x 2359354")));
  PixelFormat large = format;
  large.rows += 0x24 << 24;
  of_many_tiles[kFirstByteOfRows] = 0x24;
  EXPECT_THAT([&] { decoded_jpeg2000(of_many_tiles, large, "here"); },
              ThrowsMessage<Error>(HasSubstr("here: its JPEG 2000 pixels have more than 4096 tiles")));
}

// DCMTK 3.6.7 would read whatever lies there.
TEST_F(DecodeTest, ASegmentOfRleBehindItsFrameIsRefused) {
  const std::filesystem::path compressed = compressed_by("dcmcrle");
  const std::string bytes = text_of_file(compressed), header("\x02\0\0\0\x40\0\0\0", 8);
  const std::size_t place = bytes.find(header);
  ASSERT_NE(place, bytes.npos);
  EXPECT_NO_THROW(decompressed_frame(DicomFile::read(compressed, DicomFile::Extent::kWhole), 0));
  for (const auto& [at, byte] : {std::pair(0, '\x01'), {4, '\x41'}, {11, '\x31'}}) {
    std::string changed = bytes;
    changed[place + static_cast<std::size_t>(at)] = byte;
    std::filesystem::remove(compressed);
    write_text(compressed, changed);
    EXPECT_THAT(
        [&] { decompressed_frame(DicomFile::read(compressed, DicomFile::Extent::kWhole), 0); },
        ThrowsMessage<Error>(HasSubstr("the header of a frame in RLE is damaged: expected 2 segments, from byte 64")))
        << at;
  }
}

TEST_F(DecodeTest, RleOfAnotherNumberOfFramesIsRefused) {
  for (const char* number : {"1", "2", "99"}) {
    const DicomFile file = DicomFile::read(testdata("enhanced/rle.dcm"), DicomFile::Extent::kWhole);
    file.dataset().put(DCM_NumberOfFrames, number);
    EXPECT_THAT([&] { decompressed_frame(file, 0); },
                ThrowsMessage<Error>(HasSubstr(fmt::format("frames in RLE, expected {}", number))));
  }
}

TEST_F(DecodeTest, ADamagedFileIsRefusedAndTheNextOneRead) {
  const std::vector<std::int32_t> expected = pixels_of(study_.ct_slice(18));
  const std::filesystem::path compressed = compressed_by("dcmcjpls +el");
  std::string bytes = text_of_file(compressed);
  const std::filesystem::path damaged = study_.path() / "damaged.dcm";
  write_text(damaged, bytes.replace(bytes.size() - 600, 400, 400, '\xFF'));
  EXPECT_THROW(pixels_of(damaged), Error);
  EXPECT_EQ(pixels_of(compressed), expected);
}

}  // namespace
}  // namespace isoshift::decode_test
