// Round trips through programs that nobody of this project wrote: Orthanc, and GDCM's compression.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "tests/support/command.h"
#include "tests/support/small_study.h"

namespace isoshift::round_trip_test {
namespace {

nlohmann::json setup_error_of(const std::filesystem::path& result) {
  std::ifstream file(result / "result.json");
  return nlohmann::json::parse(file)["setup_error"];
}

TEST(RoundTrip, WhatOrthancStoredRegistersTheSame) {
  const SmallStudy study;
  const CommandOutcome registered = register_study(study, {"--write-reg-for-review"});
  ASSERT_EQ(registered.exit_status, 0) << registered.err;
  const TemporaryFolder work;
  const CommandOutcome checked =
      run_shell(fmt::format("/usr/bin/python3 {}/tests/cli/orthanc_round_trip.py {} {} {} {}", ISOSHIFT_SOURCE_DIR,
                            ISOSHIFT_PROGRAM, study.path().string(), study.output().string(), (work / "").string()));
  EXPECT_EQ(checked.exit_status, 0) << checked.out;
}

// gdcmconv to and fro: as compressed, and as decompressed again, the study is the same to the last digit.
class GdcmRoundTrip : public testing::TestWithParam<const char*> {};

TEST_P(GdcmRoundTrip, ACompressedStudyRegistersTheSame) {
  const SmallStudy study;
  ASSERT_EQ(register_study(study).exit_status, 0);
  const nlohmann::json expected = setup_error_of(study.output());
  for (const std::string& conversion : {std::string(GetParam()), std::string("--raw")}) {
    const CommandOutcome converted =
        run_shell(fmt::format("for f in {}/CT/*.dcm {}/RTIMAGE/*.dcm; do gdcmconv {} \"$f\" \"$f.new\" && mv "
                              "\"$f.new\" \"$f\" || exit 1; done",
                              study.path().string(), study.path().string(), conversion));
    ASSERT_EQ(converted.exit_status, 0) << converted.out;
    const CommandOutcome again = register_study(study, {"--overwrite"});
    EXPECT_EQ(again.exit_status, 0) << again.err;
    EXPECT_EQ(setup_error_of(study.output()), expected) << conversion;
  }
}

INSTANTIATE_TEST_SUITE_P(All, GdcmRoundTrip, testing::Values("--jpegls", "--rle", "--jpeg", "--j2k"));

}  // namespace
}  // namespace isoshift::round_trip_test
