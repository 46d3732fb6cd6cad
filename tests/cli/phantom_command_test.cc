#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <numbers>
#include <sstream>

#include "io/dicom/dicom_dataset.h"
#include "io/dicom/rt_structures.h"
#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::phantom_command_test {
namespace {

CommandOutcome make_phantom(const std::filesystem::path& folder, std::vector<std::string> more = {}) {
  std::vector<std::string> arguments = {"phantom", "-o", folder.string(), "--voxel-mm", "5", "--image-pixels", "64"};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return run_command(arguments);
}

// KVP, ReportedValuesOrigin and PatientPosition of a RADIOGRAPH are what real exports hold (docs/dicom.md 6.3). The
// plan is one for setup: its beams have one control point and no jaws.
TEST(PhantomCommand, MakesAStudyInWhichDciodvfyFindsOnlyWhatIsMeant) {
  TemporaryFolder folder;
  ASSERT_EQ(make_phantom(folder / "study", {"--bend", "neck:3"}).exit_status, 0);
  using testing::HasSubstr;
  for (const auto& [file, object] :
       {std::pair("CT/CT0000.dcm", "CTImage"), std::pair("RTPLAN.dcm", "RTPlan"),
        std::pair("RTIMAGE/KV_G000.dcm", "RTImage"), std::pair("RTSTRUCT.dcm", "RTStructureSet")}) {
    const CommandOutcome checked = run_shell("dciodvfy -new " + (folder / "study" / file).string());
    EXPECT_THAT(checked.out, HasSubstr(object)) << "it was read";
    std::istringstream lines(checked.out);
    for (std::string line; std::getline(lines, line);) {
      if (!line.starts_with("Error")) continue;
      EXPECT_THAT(
          line, testing::AnyOf(HasSubstr("/KVP("), HasSubstr("/ReportedValuesOrigin("), HasSubstr("/PatientPosition("),
                               HasSubstr("/BeamLimitingDeviceSequence("), HasSubstr("/ControlPointSequence(")))
          << file;
    }
  }
}

// Contours that are not parallel to the slices are refused.
TEST(PhantomCommand, TheTargetOfATiltedCtIsDrawnOnItsSlices) {
  TemporaryFolder folder;
  ASSERT_EQ(make_phantom(folder / "study", {"--bend", "neck:3", "--ct-tilt", "12"}).exit_status, 0);
  const RtStructures structures = read_rt_structures(folder / "study" / "RTSTRUCT.dcm");
  const Structure& target = structures.structures.at(0);
  ASSERT_GT(target.contours.size(), 3U);
  const double tilt_rad = 12.0 * std::numbers::pi / 180.0;
  const Eigen::Vector3d normal(0.0, -std::sin(tilt_rad), std::cos(tilt_rad));
  for (const Contour& contour : target.contours)
    for (const Eigen::Vector3d& point : contour.points_patient_mm)
      EXPECT_NEAR(normal.dot(point - contour.points_patient_mm.front()), 0.0, 1e-3);
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
  EXPECT_EQ(make_phantom(folder / "a", {"--gantry-angles", "0,400"}).exit_status, 2);
  EXPECT_EQ(make_phantom(folder / "a", {"--couch-angle", "1e9"}).exit_status, 2);
  EXPECT_EQ(make_phantom(folder / "a", {"--translation", "1e9,0,0"}).exit_status, 2);
  EXPECT_EQ(make_phantom(folder / "a", {"--bend", "knee"}).exit_status, 2);
  EXPECT_THAT(make_phantom(folder / "a", {"--bend", "neck,spine:3"}).err, testing::HasSubstr("--bend spine"));
  EXPECT_FALSE(std::filesystem::exists(folder / "a"));
}

}  // namespace
}  // namespace isoshift::phantom_command_test
