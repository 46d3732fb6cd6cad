#include "io/dicom/decoder_messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/message_line.h"

namespace isoshift::decoder_messages_test {
namespace {

using testing::HasSubstr;

TEST(DecoderMessages, ComeBackAsTheyWere) {
  for (const char* path : {"/in/a b.dcm", "/in/M\xC3\xBCller.dcm", "/in/M\xFCller\n.dcm"}) {
    const FrameToDecode request{.path = path, .sha256 = "ab12", .frame = 3};
    EXPECT_EQ(frame_to_decode_from(line_without_end(to_line(request)), ""), request) << path;
    const DecodedFrame refused{.error = path, .bytes = 0};
    EXPECT_EQ(decoded_frame_from(line_without_end(to_line(refused)), ""), refused) << path;
  }
  const DecodedFrame decoded{.error = std::nullopt, .bytes = 1ULL << 40};
  EXPECT_EQ(decoded_frame_from(line_without_end(to_line(decoded)), ""), decoded);
}

TEST(DecoderMessages, DamagedAndUnknownOnesAreErrorsThatNameTheSender) {
  const auto error_of = [](const std::string& line) -> std::string {
    try {
      (void)decoded_frame_from(line, "the decoder");
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  };
  EXPECT_THAT(error_of(""), HasSubstr("the decoder: is not JSON"));
  EXPECT_THAT(error_of("{\"bytes\": "), HasSubstr("the decoder: is not JSON"));
  EXPECT_EQ(error_of("[1]"), "the decoder: expected an object");
  EXPECT_THAT(error_of("{}"), HasSubstr("the decoder: bytes is missing"));
  EXPECT_THAT(error_of("{\"bytes\": 1.5}"), HasSubstr("the decoder: bytes is 1.5"));
  EXPECT_THAT(error_of("{\"bytes\": 1, \"bytes\": 2}"), HasSubstr("the decoder: says bytes twice"));
  EXPECT_THAT(error_of("{\"bytes\": 1, \"pixels\": 2}"), HasSubstr("the decoder: there is no key pixels"));
  EXPECT_THROW((void)frame_to_decode_from("{\"path\": \"a\"}", "the parent"), Error);
}

}  // namespace
}  // namespace isoshift::decoder_messages_test
