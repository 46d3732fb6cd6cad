// Real X-rays of a steel ball by a TrueBeam (tests/real_data/README.md): they decide the signs of gantry angle,
// receptor translation and couch axes against a real machine.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/output_folder.h"
#include "cli/console.h"
#include "io/dicom/rt_image.h"
#include "registration/preprocess/preprocess.h"
#include "tests/support/command.h"
#include "tests/support/pose_near.h"
#include "tests/support/real_data.h"
#include "tests/support/temporary_folder.h"
#include "workflow/register/truth.h"

namespace isoshift::winston_lutz_test {
namespace {

class WinstonLutz : public testing::Test {
 protected:
  void unpack(const std::string& zip) {
    const CommandOutcome unpacked = run_shell(fmt::format("cd {} && cmake -E tar xf {}", folder_.path().string(), zip));
    ASSERT_EQ(unpacked.exit_status, 0) << unpacked.out;
  }

  // The ball's position, mm from the isocenter, IEC 61217 fixed.
  Eigen::Vector3d registered(const std::string& set) {
    for (const std::string& name : {set, std::string("ball-ct")})
      unpack((real_data() / "winston-lutz" / (name + ".zip")).string());
    const std::filesystem::path output = folder_ / ("result-" + set);
    const CommandOutcome outcome = run_command(
        {"register", (folder_ / set).string(), "--ct", (folder_ / "ball").string(), "-o", output.string(), "--dof",
         "translation", "--isocenter", "0,0,0", "--patient-position", "HFS", "--intensity", "LIN+"});
    // A ball looks the same from opposite sides: off center, exchanged views would mean another pose, for review.
    EXPECT_THAT(outcome.exit_status, testing::AnyOf(kExitAccepted, kExitReview)) << outcome.err;
    return read_setup_error(output / "result.json").translation();
  }

  TemporaryFolder folder_;
};

TEST_F(WinstonLutz, TheBallIsFoundWhereThePanelGeometryHasIt) {
  ISOSHIFT_NEED_REAL_DATA("winston-lutz");
  const Eigen::Vector3d cardinal = registered("cardinal"), lateral = registered("lat3mm");
  EXPECT_THAT(cardinal, VectorNear(Eigen::Vector3d(0.48, -0.72, -0.75), 0.15));
  EXPECT_THAT(lateral, VectorNear(Eigen::Vector3d(3.47, -0.72, -0.80), 0.15));
  // The couch's read-outs moved by this much between the sets.
  EXPECT_THAT(Eigen::Vector3d(lateral - cardinal), VectorNear(Eigen::Vector3d(3.01, 0.01, -0.04), 0.1));
}

// The first example of docs/commands/commission.md: read-outs of the couch, and positions found by other means.
TEST_F(WinstonLutz, CommissionsItsLocalization) {
  ISOSHIFT_NEED_REAL_DATA("winston-lutz");
  for (const char* name : {"cardinal", "lat3mm", "ball-ct"})
    unpack((real_data() / "winston-lutz" / fmt::format("{}.zip", name)).string());
  write_text(folder_ / "cases.csv", "case,ct,images\ncardinal,ball,cardinal\nlat3mm,ball,lat3mm\n");
  write_text(folder_ / "positions.csv", "session,x_mm,y_mm,z_mm\ncardinal,0.48,-0.72,-0.75\nlat3mm,3.47,-0.72,-0.80\n");
  const std::string results = (folder_ / "results").string();
  run_command({"batch", (folder_ / "cases.csv").string(), "-o", results, "--dof", "translation", "--isocenter", "0,0,0",
               "--patient-position", "HFS", "--intensity", "LIN+"});

  const auto moves = nlohmann::json::parse(run_command({"qa", "commission", results, "--json"}).out);
  EXPECT_EQ(moves["outcome"], "untested");
  EXPECT_EQ(moves["known_from"], "read-outs");
  EXPECT_EQ(moves["axes"]["x_mm"]["polarity"], "passed");
  EXPECT_NEAR(moves["axes"]["x_mm"]["known_to"], 3.01, 0.005);
  for (const char* axis : {"y_mm", "z_mm"}) EXPECT_EQ(moves["axes"][axis]["polarity"], "untested");
  for (const char* axis : {"rx_deg", "ry_deg", "rz_deg"}) EXPECT_EQ(moves["axes"][axis]["count"], 0);
  EXPECT_EQ(moves["tested"]["gantry_angles_deg"], nlohmann::json({"0/90/180/270"}));

  const auto positions = nlohmann::json::parse(
      run_command({"qa", "commission", results, "--positions", (folder_ / "positions.csv").string(), "--json"}).out);
  for (const char* axis : {"x_mm", "y_mm", "z_mm"}) {
    EXPECT_LT(moves["axes"][axis]["largest"], 0.1) << axis;
    EXPECT_LT(std::abs(positions["axes"][axis]["bias"].get<double>()), 0.1) << axis;
  }
}

// The table's read-outs moved by (3.01, 0.01, -0.04) mm; nobody knows where the receptor really lies.
TEST_F(WinstonLutz, TellsOfItsReceptorWhatASingleBallCan) {
  ISOSHIFT_NEED_REAL_DATA("winston-lutz");
  for (const char* name : {"cardinal", "lat3mm", "ball-ct"})
    unpack((real_data() / "winston-lutz" / fmt::format("{}.zip", name)).string());
  const CommandOutcome outcome =
      run_command({"qa", "geometry", (folder_ / "cardinal").string(), (folder_ / "lat3mm").string(), "--ct",
                   (folder_ / "ball").string(), "--isocenter", "0,0,0", "--patient-position", "HFS", "--intensity",
                   "LIN+", "--json"});
  ASSERT_EQ(outcome.exit_status, kExitAccepted) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_EQ(json["places_used"], 8);
  for (const char* axis : {"x_mm", "y_mm", "z_mm"})
    EXPECT_TRUE(json["sessions"]["cardinal"]["setup_error"][axis].is_null()) << "sag or a shift looks alike: " << axis;
  const auto& moved = json["sessions"]["lat3mm"]["moved"];
  EXPECT_NEAR(moved["x_mm"].get<double>(), 3.01, 0.02);
  EXPECT_NEAR(moved["y_mm"].get<double>(), 0.01, 0.02);
  EXPECT_NEAR(moved["z_mm"].get<double>(), -0.04, 0.02);
  const auto& receptor = json["imagers"]["MV"];
  EXPECT_NEAR(receptor["shift_x_mm"]["value"].get<double>(), -0.09, 0.03);
  for (const char* unknown :
       {"shift_x_cos_mm", "shift_x_sin_mm", "shift_y_mm", "distance_mm", "roll_deg", "tilt_x_deg", "tilt_y_deg"})
    EXPECT_FALSE(receptor[unknown]["is_determined"].get<bool>()) << unknown;
}

TEST_F(WinstonLutz, TheReceptorTranslationHasTheSignOfTheImageContent) {
  ISOSHIFT_NEED_REAL_DATA("rt-image-dialects.zip");
  unpack((real_data() / "rt-image-dialects.zip").string());
  // Where the field ends at the right, and its middle between top and bottom: edges that both images show whole. Jaws
  // are found where the 90th percentile of a column or row falls below 30 % of the bright pixels.
  const auto field_edge_px = [&](const std::string& name) {
    Notes notes;
    RtImage image = read_rt_images(folder_ / name, notes).front();
    image.intensity_relationship = "LIN";
    image.intensity_sign = 1;
    const XrayImage xray = read_xray_image(DicomFile::read(image.path, DicomFile::Extent::kWhole), image,
                                           xray_view(image, Beam::kMegavoltage, notes));
    const auto percentile = [](std::vector<float> values, double share) {
      const auto nth = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
      std::ranges::nth_element(values, nth);
      return *nth;
    };
    const float bright = 0.3F * percentile(xray.values.pixels, 0.99);
    int right = 0, top = xray.values.rows, bottom = 0;
    for (int column = 0; column < xray.values.columns; ++column) {
      std::vector<float> along;
      for (int row = 0; row < xray.values.rows; ++row) along.push_back(xray.values.at(column, row));
      if (percentile(along, 0.9) > bright) right = column;
    }
    for (int row = 0; row < xray.values.rows; ++row) {
      std::vector<float> along;
      for (int column = 0; column < xray.values.columns; ++column) along.push_back(xray.values.at(column, row));
      if (percentile(along, 0.9) > bright) {
        top = std::min(top, row);
        bottom = row;
      }
    }
    return std::pair(Eigen::Vector2d(right, 0.5 * (top + bottom)), xray.view);
  };
  const auto [centered, centered_view] = field_edge_px("truebeam-panel-centered.dcm");
  const auto [translated, translated_view] = field_edge_px("truebeam-panel-translated.dcm");
  // The content moves by about (-20, +29) mm on the panel: against the panel's motion; rows count downward.
  const Eigen::Vector2d moved_mm =
      0.336 * Eigen::Vector2d(translated.x() - centered.x(), -(translated.y() - centered.y()));
  EXPECT_THAT(moved_mm, VectorNear(Eigen::Vector2d(-20, 29), 1.0));
  // Understood as written, the field lies at the same place about the axis in both: a wrong sign would tear it 40 and
  // 60 mm apart.
  const Eigen::Vector2d off_axis = (centered - centered_view.project(Eigen::Vector3d::Zero()).value()) -
                                   (translated - translated_view.project(Eigen::Vector3d::Zero()).value());
  EXPECT_LT(0.336 * off_axis.norm(), 2.0);
}

}  // namespace
}  // namespace isoshift::winston_lutz_test
