// RT Images as real machines write them (tests/real_data/README.md): what is missing must be refused by name.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/command.h"
#include "tests/support/real_data.h"
#include "tests/support/small_study.h"

namespace isoshift::rt_image_dialects_test {
namespace {

using testing::HasSubstr;

class RtImageDialects : public testing::Test {
 protected:
  void SetUp() override {
    ISOSHIFT_NEED_REAL_DATA("rt-image-dialects.zip");
    const CommandOutcome unpacked = run_shell(fmt::format("cd {} && cmake -E tar xf {}", folder_.path().string(),
                                                          (real_data() / "rt-image-dialects.zip").string()));
    ASSERT_EQ(unpacked.exit_status, 0) << unpacked.out;
  }

  // Registers one of the images with the phantom's CT and plan; the image is refused before they are compared.
  std::string refusal(const std::string& name) {
    const CommandOutcome outcome = run_command(
        {"register", phantom_.path().string(), "--image", (folder_ / name).string(), "-o", phantom_.output().string()});
    EXPECT_EQ(outcome.exit_status, 1);
    EXPECT_FALSE(std::filesystem::exists(phantom_.output()));
    return outcome.err;
  }

  TemporaryFolder folder_;
  SmallStudy phantom_;
};

TEST_F(RtImageDialects, ClinacAs500IsRefusedByName) {
  const std::string message = refusal("clinac-as500-no-gantry.dcm");
  for (const char* tag : {"GantryAngle (300A,011E) is missing.\n       Supply it: --gantry-angle SID00222=DEG",
                          "RTImagePosition (3002,0012) is missing", "PatientSupportAngle (300A,0122) is missing"})
    EXPECT_THAT(message, HasSubstr(tag));
}

TEST_F(RtImageDialects, ElektaIviewIsRefusedByName) {
  const std::string message = refusal("elekta-iview-no-position.dcm");
  for (const char* tag : {"RTImagePosition (3002,0012) is missing", "PatientSupportAngle (300A,0122) is missing",
                          "ReportedValuesOrigin (3002,000A) says OPERATOR", "--allow planned-geometry=REASON"})
    EXPECT_THAT(message, HasSubstr(tag));
}

TEST_F(RtImageDialects, MosaiqIsRefusedByName) {
  EXPECT_THAT(
      refusal("mosaiq-no-position.dcm"),
      HasSubstr(
          "RTImagePosition (3002,0012) is missing.\n       Supply it: --rt-image-position X,Y or --assume-centered"));
}

TEST_F(RtImageDialects, EclipseDrrIsRefusedByName) {
  const std::string message = refusal("eclipse-drr.dcm");
  EXPECT_THAT(message, HasSubstr("ImageType (0008,0008) says DRR: this is not an X-ray"));
  EXPECT_THAT(message, HasSubstr("--allow drr=REASON"));
}

TEST_F(RtImageDialects, InspectPrintsGeometryAndMissingTagsOfEach) {
  const CommandOutcome outcome = run_command({"inspect", folder_.path().string()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path()))
    EXPECT_THAT(outcome.out, HasSubstr(entry.path().string()));
  EXPECT_THAT(outcome.out, HasSubstr("  receptor translation     (20.0005, -29.9977, -499.976) mm\n"));
}

}  // namespace
}  // namespace isoshift::rt_image_dialects_test
