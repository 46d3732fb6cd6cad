#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

#include "io/dicom/dicom_dataset.h"
#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"

namespace isoshift {
namespace {

CommandOutcome make_phantom(const std::filesystem::path& folder, std::vector<std::string> more = {}) {
  std::vector<std::string> arguments = {"phantom", "-o", folder.string(), "--voxel-mm", "5", "--image-pixels", "64"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run_command(arguments);
}

TEST(PhantomCommand, MakesAStudyThatDciodvfyAccepts) {
  TemporaryFolder folder;
  ASSERT_EQ(make_phantom(folder / "study").exit_status, 0);
  for (const char* file : {"CT/CT0000.dcm", "RTPLAN.dcm", "RTIMAGE/KV_G000.dcm"}) {
    const CommandOutcome checked =
        run_shell("dciodvfy -new " + (folder / "study" / file).string() + " | grep '^Error'");
    // Known false positive (docs/dicom.md 6.3): KVP in the Exposure Sequence of a RADIOGRAPH.
    std::istringstream lines(checked.out);
    for (std::string line; std::getline(lines, line);) EXPECT_THAT(line, testing::HasSubstr("KVP")) << file;
  }
}

TEST(PhantomCommand, SameSeedMakesTheSameStudy) {
  TemporaryFolder folder;
  make_phantom(folder / "a");
  make_phantom(folder / "b");
  make_phantom(folder / "c", {"--seed", "2"});
  const auto uid = [&](const char* study) {
    return DicomFile::read(folder / study / "RTIMAGE" / "KV_G090.dcm", DicomFile::Extent::kHeader)
        .dataset()
        .required_text(DCM_SOPInstanceUID);
  };
  EXPECT_EQ(uid("a"), uid("b"));
  EXPECT_NE(uid("a"), uid("c"));
}

TEST(PhantomCommand, BentStudyHasItsTarget) {
  TemporaryFolder folder;
  ASSERT_EQ(make_phantom(folder / "bent", {"--bend", "neck:4,jaw"}).exit_status, 0);
  const CommandOutcome inspected = run_command({"inspect", (folder / "bent").string()});
  EXPECT_EQ(inspected.exit_status, 0) << inspected.err;
  EXPECT_THAT(inspected.out, testing::HasSubstr("PTV"));
}

TEST(PhantomCommand, RefusesNonsense) {
  TemporaryFolder folder;
  EXPECT_EQ(make_phantom(folder / "a", {"--patient-position", "HFX"}).exit_status, 2);
  EXPECT_EQ(make_phantom(folder / "a", {"--photons", "-1"}).exit_status, 2);
  EXPECT_EQ(make_phantom(folder / "a", {"--translation", "nan,0,0"}).exit_status, 2);
  EXPECT_EQ(make_phantom(folder / "a", {"--gantry-angles", "30.2,30.4"}).exit_status, 2);
  EXPECT_EQ(make_phantom(folder / "a", {"--bend", "knee"}).exit_status, 2);
  EXPECT_THAT(make_phantom(folder / "a", {"--bend", "neck,spine:3"}).err, testing::HasSubstr("--bend spine"));
  EXPECT_FALSE(std::filesystem::exists(folder / "a"));
}

}  // namespace
}  // namespace isoshift
