// isoshift scout, from files to the offset. The scout is a scan of shapes by lines, written here without any camera,
// projection or renderer of the program.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "io/dicom/decode.h"
#include "phantom/study_writer.h"
#include "tests/support/command.h"
#include "tests/support/small_study.h"

namespace isoshift::scout_command_test {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;
using Json = nlohmann::json;

// A lateral scan of the phantom's head, the tube on the patient's left: rows across the table along the patient's y,
// from the head down.
struct Scan {
  Vector3d planted_mm = Vector3d::Zero();  // by how much too far left, posterior, superior its file says it lies
  double tube_side = 1.0;                  // of the patient's x
  bool is_mirrored = false;
  std::uint64_t anatomy = 1;
};

class ScoutCommandTest : public testing::Test {
 protected:
  static constexpr int kColumns = 240, kRows = 200;
  static constexpr double kPixelMm = 1.0, kSadMm = 570.0, kSidMm = 1040.0;

  static PhantomOptions head() {
    PhantomOptions options = small_phantom();
    options.voxel_mm = 2.0;
    return options;
  }

  void write_scout(const Scan& scan) {
    PhantomOptions options = head();
    options.seed = scan.anatomy;
    const std::vector<Shape> shapes = phantom_of(options).in_ct;
    const Vector3d center = options.placement.isocenter_patient_mm;
    std::vector<std::uint16_t> stored;
    for (int row = 0; row < kRows; ++row)
      for (int column = 0; column < kColumns; ++column) {
        const double across = ((scan.is_mirrored ? kColumns - 1 - column : column) - 0.5 * (kColumns - 1)) * kPixelMm;
        const double along = (0.5 * (kRows - 1) - row) * kPixelMm;
        const Vector3d source = center + Vector3d(scan.tube_side * kSadMm, 0.0, along);
        const Vector3d detector = source + kSidMm / kSadMm * (center + Vector3d(0.0, across, along) - source);
        double line_integral = 0.0;
        for (const Shape& shape : shapes)
          line_integral += shape.chord_mm(source, detector) * (0.02 * shape.added.water + 0.06 * shape.added.bone);
        stored.push_back(static_cast<std::uint16_t>(200.0 + 4000.0 * std::max(0.0, line_integral)));
      }
    std::filesystem::copy_file(study_.ct_slice(0), scout(), std::filesystem::copy_options::overwrite_existing);
    edit(scout(), [&](DicomItem d) {
      const Vector3d first =
          center + scan.planted_mm + Vector3d(0.0, -0.5 * (kColumns - 1), 0.5 * (kRows - 1)) * kPixelMm;
      d.put(DCM_ImageType, "ORIGINAL\\PRIMARY\\LOCALIZER");
      d.put(DCM_SOPInstanceUID, new_uid());
      d.put(DCM_ImagePositionPatient, std::array{first.x(), first.y(), first.z()});
      d.put(DCM_ImageOrientationPatient, std::array{0.0, 1.0, 0.0, 0.0, 0.0, -1.0});
      d.put(DCM_PixelSpacing, std::array{kPixelMm, kPixelMm});
      d.put(DCM_DistanceSourceToPatient, kSadMm);
      d.put(DCM_DistanceSourceToDetector, kSidMm);
      put_pixel_format(d, {.columns = kColumns, .rows = kRows});
      d.put_pixels(stored);
    });
  }

  CommandOutcome run(std::vector<std::string> flags = {}) {
    flags.insert(flags.begin(), {"scout", (study_.path() / "CT").string(), scout().string()});
    return run_command(flags);
  }
  Json result(std::vector<std::string> flags = {}) {
    flags.emplace_back("--json");
    return Json::parse(run(flags).out);
  }
  std::filesystem::path scout() const { return study_.path() / "scout.dcm"; }

  SmallStudy study_{head()};
};

double offset(const Json& result, const char* axis) { return result["axes"][axis]["offset_mm"]; }

TEST_F(ScoutCommandTest, ItsOwnScoutIsWhereTheCtSays) {
  write_scout({});
  const Json found = result();
  EXPECT_EQ(found["verdict"], "accepted") << found["reasons"];
  EXPECT_EQ(found["tube"], "left");
  EXPECT_FALSE(found["axes"]["left"]["is_seen"]) << "along the rays";
  for (const char* axis : {"posterior", "superior"}) {
    EXPECT_TRUE(found["axes"][axis]["is_seen"]) << axis;
    EXPECT_NEAR(offset(found, axis), 0.0, 0.25) << axis;
    EXPECT_LT(found["axes"][axis]["repeatability_mm"], 0.1) << axis;
  }
  EXPECT_NEAR(found["axes"]["about_left"]["offset_deg"].get<double>(), 0.0, 0.2);
  EXPECT_LT(found["axes"]["about_left"]["repeatability_deg"], 0.1);
}

// The file says that the scan lay too far posterior and superior: there the CT does not show what it shows.
TEST_F(ScoutCommandTest, AScanThatLiesElsewhereIsMeasured) {
  write_scout({.planted_mm = {0.0, 3.0, -2.0}});
  const Json found = result();
  EXPECT_NEAR(offset(found, "posterior"), 3.0, 0.25);
  EXPECT_NEAR(offset(found, "superior"), -2.0, 0.25);
}

TEST_F(ScoutCommandTest, TheOtherSideOfTheTubeIsNotAccepted) {
  write_scout({});
  const CommandOutcome outcome = run({"--tube", "right"});
  EXPECT_NE(outcome.exit_status, 0);
  EXPECT_THAT(outcome.out, HasSubstr("with the tube on the left side the scout matches better"));
  write_scout({.tube_side = -1.0});
  EXPECT_EQ(result()["tube"], "right");
  EXPECT_THAT(run({"--tube", "anterior"}).err,
              HasSubstr("--tube anterior: the scout's plane has its sides left and right"));
}

TEST_F(ScoutCommandTest, MirroredScoutsAndThoseOfOthersAreNotAccepted) {
  write_scout({.is_mirrored = true});
  EXPECT_NE(run().exit_status, 0);
  write_scout({.anatomy = 4});
  EXPECT_NE(run().exit_status, 0);
  edit(scout(), [](DicomItem d) { d.put(DCM_PatientID, "SOMEBODY"); });
  EXPECT_THAT(run().err, HasSubstr("PatientID (0010,0020) differs from that of the CT"));
}

TEST_F(ScoutCommandTest, WhatIsNoScoutOrLacksItsDistancesIsRefused) {
  write_scout({});
  edit(scout(), [](DicomItem d) { d.erase(DCM_DistanceSourceToPatient); });
  EXPECT_THAT(run().err, HasSubstr("DistanceSourceToPatient (0018,1111) is missing\n       --sad MM supplies it"));
  EXPECT_EQ(result({"--sad", "570"})["overrides"].size(), 1U);
  edit(scout(), [](DicomItem d) { d.put(DCM_ImageOrientationPatient, std::array{0.0, 0.8, 0.6, 0.0, 0.6, -0.8}); });
  EXPECT_THAT(run({"--sad", "570"}).err, HasSubstr("expected rows across the table"));
  edit(scout(), [](DicomItem d) { d.put(DCM_ImageType, "ORIGINAL\\PRIMARY\\AXIAL"); });
  EXPECT_THAT(run().err, HasSubstr("is no localizer of a CT"));
}

}  // namespace
}  // namespace isoshift::scout_command_test
