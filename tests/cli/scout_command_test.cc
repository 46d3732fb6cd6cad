// isoshift qa scout, from files to the offset. The scout is a scan of shapes by lines, written here without any camera,
// projection or renderer of the program.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dcitem.h>
#include <fmt/format.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "base/sha256.h"
#include "io/dicom/decode.h"
#include "phantom/study_writer.h"
#include "tests/support/command.h"
#include "tests/support/small_study.h"

namespace isoshift::scout_command_test {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;
using Json = nlohmann::json;

// A scan of the phantom's head, unless told otherwise a lateral one with the tube on the patient's left, rows across
// the table along the patient's y, from the head down.
struct Scan {
  Vector3d planted_mm = Vector3d::Zero();   // by how much too far left, posterior, superior its file says it lies
  Vector3d along_rays = Vector3d::UnitX();  // toward the tube
  Vector3d along_rows = Vector3d::UnitY(), along_columns = -Vector3d::UnitZ();
  std::string patient_position = "HFS";
  double said_by_real_pixel = 1.0;  // the file's pixels, across the table, by those of the scan
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
        const Vector3d along = (row - 0.5 * (kRows - 1)) * kPixelMm * scan.along_columns;
        const Vector3d source = center + kSadMm * scan.along_rays + along;
        const Vector3d detector = source + kSidMm / kSadMm * (center + across * scan.along_rows + along - source);
        double line_integral = 0.0;
        for (const Shape& shape : shapes)
          line_integral += shape.chord_mm(source, detector) * (0.02 * shape.added.water + 0.06 * shape.added.bone);
        stored.push_back(static_cast<std::uint16_t>(200.0 + 4000.0 * std::max(0.0, line_integral)));
      }
    std::filesystem::copy_file(study_.ct_slice(0), scout(), std::filesystem::copy_options::overwrite_existing);
    edit(scout(), [&](DicomItem d) {
      const double said_mm = scan.said_by_real_pixel * kPixelMm;
      const Vector3d first = center + scan.planted_mm - 0.5 * (kColumns - 1) * said_mm * scan.along_rows -
                             0.5 * (kRows - 1) * kPixelMm * scan.along_columns;
      d.put(DCM_ImageType, "ORIGINAL\\PRIMARY\\LOCALIZER");
      d.put(DCM_SOPInstanceUID, new_uid());
      d.put(DCM_ImagePositionPatient, std::array{first.x(), first.y(), first.z()});
      d.put(DCM_ImageOrientationPatient,
            std::array{scan.along_rows.x(), scan.along_rows.y(), 0.0, 0.0, 0.0, scan.along_columns.z()});
      d.put(DCM_PixelSpacing, std::array{kPixelMm, said_mm});
      d.put(DCM_PatientPosition, scan.patient_position);
      d.put(DCM_DistanceSourceToPatient, kSadMm);
      d.put(DCM_DistanceSourceToDetector, kSidMm);
      put_pixel_format(d, {.columns = kColumns, .rows = kRows});
      d.put_pixels(stored);
    });
  }

  CommandOutcome run(std::vector<std::string> flags = {}) {
    flags.insert(flags.begin(), {"qa", "scout", (study_.path() / "CT").string(), scout().string()});
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

// The file says that the scan lay too far posterior and superior: there the CT does not show what it shows. Scanners
// write rows and columns either way, as the patient lies.
TEST_F(ScoutCommandTest, AScanThatLiesElsewhereIsMeasuredHoweverThePatientLies) {
  const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY(), z = Vector3d::UnitZ();
  const Scan scans[] = {
      {.along_rays = x, .along_rows = y, .along_columns = -z, .patient_position = "HFS"},
      {.along_rays = -x, .along_rows = -y, .along_columns = z, .patient_position = "FFS"},
      {.along_rays = -y, .along_rows = x, .along_columns = -z, .patient_position = "HFS"},
      {.along_rays = y, .along_rows = -x, .along_columns = -z, .patient_position = "HFP"},
      {.along_rays = y, .along_rows = x, .along_columns = z, .patient_position = "FFP"},
  };
  for (Scan scan : scans) {
    scan.planted_mm = {-4.0, 3.0, -2.0};
    write_scout(scan);
    const Json found = result();
    SCOPED_TRACE(fmt::format("{}, tube {}", scan.patient_position, found["tube"].get<std::string>()));
    const bool is_lateral = scan.along_rays.y() == 0.0;
    EXPECT_EQ(found["tube"], scan.along_rays.x() > 0   ? "left"
                             : scan.along_rays.x() < 0 ? "right"
                             : scan.along_rays.y() > 0 ? "posterior"
                                                       : "anterior");
    EXPECT_EQ(found["scout"]["patient_position"], scan.patient_position);
    EXPECT_EQ(found["axes"]["left"]["is_seen"], !is_lateral);
    EXPECT_EQ(found["axes"]["posterior"]["is_seen"], is_lateral);
    EXPECT_NEAR(is_lateral ? offset(found, "posterior") : offset(found, "left"), is_lateral ? 3.0 : -4.0, 0.3);
    EXPECT_NEAR(offset(found, "superior"), -2.0, 0.3);
  }
}

// A pixel spacing that is wrong across the table looks like a patient nearer to the tube.
TEST_F(ScoutCommandTest, AWrongSpacingAcrossTheTableIsNotAccepted) {
  write_scout({.said_by_real_pixel = 1.04});
  const CommandOutcome outcome = run();
  EXPECT_NE(outcome.exit_status, 0);
  EXPECT_THAT(outcome.out, HasSubstr("times as wide as spacing and distances say"));
}

// A scout of which somebody has cut off columns of one side: the central ray no longer meets the middle of its rows.
TEST_F(ScoutCommandTest, AScoutThatWasCutToOneSideIsNotAccepted) {
  write_scout({});
  constexpr int kCut = 90;
  edit(scout(), [](DicomItem d) {
    const Uint16* stored = nullptr;
    ASSERT_TRUE(d.dcmtk().findAndGetUint16Array(DCM_PixelData, stored).good());
    std::vector<std::uint16_t> kept;
    kept.reserve(std::size_t{kColumns - kCut} * kRows);
    for (int row = 0; row < kRows; ++row)
      for (int column = kCut; column < kColumns; ++column) kept.push_back(stored[row * kColumns + column]);
    std::vector<double> first = d.required_numbers(DCM_ImagePositionPatient, 3);
    first[1] += kCut * kPixelMm;
    d.put(DCM_ImagePositionPatient, first);
    put_pixel_format(d, {.columns = kColumns - kCut, .rows = kRows});
    d.put_pixels(kept);
  });
  const CommandOutcome outcome = run();
  EXPECT_NE(outcome.exit_status, 0);
  EXPECT_THAT(outcome.out, HasSubstr("beside the middle of the rows looks the same: has the scout been cut?"));
}

TEST_F(ScoutCommandTest, ItsFilesAreWrittenWholeOrNotAtAll) {
  write_scout({});
  const std::filesystem::path folder = study_.output();
  const CommandOutcome outcome = run({"-o", folder.string()});
  EXPECT_THAT(outcome.out, HasSubstr("Written to " + folder.string()));
  std::ifstream file(folder / "scout.json");
  const Json written = Json::parse(file);
  for (const char* name : {"scout.pdf", "scout.png"})
    EXPECT_EQ(written["files_sha256"][name], sha256_of_file(folder / name)) << name;
  EXPECT_EQ(written["patient"]["id"], result()["patient"]["id"]);
  // Refused before anything is read.
  const CommandOutcome again = run_command({"qa", "scout", "no-ct", "no-scout", "-o", folder.string()});
  EXPECT_EQ(again.exit_status, 1);
  EXPECT_THAT(again.err, HasSubstr("--overwrite"));
  EXPECT_EQ(run({"-o", folder.string(), "--overwrite"}).exit_status, outcome.exit_status);
  EXPECT_EQ(run_command({"qa", "scout", "no-ct", "no-scout", "-o", (study_.path() / "none").string()}).exit_status, 1);
  EXPECT_FALSE(std::filesystem::exists(study_.path() / "none"));
}

TEST_F(ScoutCommandTest, WhatWasSuppliedAndWhoseScoutItIsIsSaid) {
  write_scout({.patient_position = "FFS"});
  const CommandOutcome outcome = run({"--sad", "571"});
  EXPECT_THAT(outcome.out, HasSubstr("OVERRIDES    (what a person supplied or allowed)\n  - "));
  EXPECT_THAT(outcome.out, HasSubstr("--sad MM: 571 mm for DistanceSourceToPatient (0018,1111), which is 570"));
  EXPECT_THAT(outcome.out, HasSubstr("the scout says FFS"));
  EXPECT_THAT(outcome.out, HasSubstr("SOP Instance UID 2.25."));
  EXPECT_THAT(outcome.err, HasSubstr("PatientPosition (0018,5100) is FFS, that of the CT HFS"));
  edit(scout(), [](DicomItem d) { d.erase(DCM_PatientPosition); });
  EXPECT_TRUE(result()["scout"]["patient_position"].is_null());
}

TEST_F(ScoutCommandTest, TheOtherSideOfTheTubeIsNotAccepted) {
  write_scout({});
  const CommandOutcome outcome = run({"--tube", "right"});
  EXPECT_NE(outcome.exit_status, 0);
  EXPECT_THAT(outcome.out, HasSubstr("with the tube on the left side the scout matches better"));
  write_scout({.along_rays = -Vector3d::UnitX()});
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

// Columns that were not measured, as some scanners fill them, are no edges of anything.
TEST_F(ScoutCommandTest, PaddingShowsNothing) {
  write_scout({});
  edit(scout(), [](DicomItem d) {
    const Uint16* stored = nullptr;
    ASSERT_TRUE(d.dcmtk().findAndGetUint16Array(DCM_PixelData, stored).good());
    std::vector<std::uint16_t> padded(stored, stored + std::size_t{kColumns} * kRows);
    for (std::size_t n = 0; n < padded.size(); ++n)
      if (n % kColumns < 25 || n % kColumns >= kColumns - 25) padded[n] = 63536;
    d.put_pixels(padded);
    d.put(DCM_PixelPaddingValue, 63536.0);
  });
  const Json found = result();
  EXPECT_EQ(found["verdict"], "accepted") << found["reasons"];
  EXPECT_NEAR(offset(found, "posterior"), 0.0, 0.25);
}

TEST_F(ScoutCommandTest, WrongCallsSayWhatIsWanted) {
  write_scout({});
  const std::string ct = (study_.path() / "CT").string();
  EXPECT_THAT(run_command({"qa", "scout", scout().string(), ct}).err,
              HasSubstr(ct + ": is a folder, expected the file of a scout (the CT is named first, then its scout)"));
  EXPECT_THAT(run_command({"qa", "scout", scout().string(), scout().string()}).err, HasSubstr("holds no CT series"));
  const CommandOutcome splat = run({"--renderer", "splat"});
  EXPECT_EQ(splat.exit_status, 2);
  EXPECT_THAT(splat.err, HasSubstr("--renderer splat: cannot render scouts; cpu, raycast, siddon and trilinear can"));
  // A distance in cm.
  EXPECT_THAT(run({"--sad", "57"}).err, HasSubstr("expected 300 to 1500 mm and a larger one"));
}

TEST_F(ScoutCommandTest, AScoutThatShowsNothingOfTheCtIsRefused) {
  write_scout({.planted_mm = {0.0, 0.0, 500.0}});
  EXPECT_THAT(run().err, HasSubstr("they must have at least 20 mm of the patient in common"));
  edit(scout(), [](DicomItem d) { d.put_pixels(std::vector<std::uint16_t>(std::size_t{kColumns} * kRows, 7)); });
  EXPECT_THAT(run().err, HasSubstr("is blank: all its pixels hold 7"));
}

}  // namespace
}  // namespace isoshift::scout_command_test
