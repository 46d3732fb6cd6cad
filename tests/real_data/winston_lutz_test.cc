// Real X-rays of a steel ball by a TrueBeam (data/README.md): they decide the signs of gantry angle, receptor
// translation and couch axes against a real machine.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "cli/truth.h"
#include "io/rt_image.h"
#include "registration/preprocess/preprocess.h"
#include "tests/support/command.h"
#include "tests/support/pose_near.h"
#include "tests/support/real_data.h"
#include "tests/support/temporary_folder.h"

namespace isoshift {
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
        {"register", (folder_ / set).string(), "--ct", (folder_ / "ball-ct").string(), "-o", output.string(), "--dof",
         "translation", "--isocenter", "0,0,0", "--patient-position", "HFS", "--intensity", "LIN+"});
    EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
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

TEST_F(WinstonLutz, TheReceptorTranslationHasTheSignOfTheImageContent) {
  ISOSHIFT_NEED_REAL_DATA("rt-image-dialects.zip");
  unpack((real_data() / "rt-image-dialects.zip").string());
  // The middle of the field in the room's plane through the isocenter, along the rows' jaws, which both images show
  // whole.
  const auto field_center_px = [&](const std::string& name) {
    RtImage image = read_rt_image_header(folder_ / name);
    image.intensity_relationship = "LIN";
    image.intensity_sign = 1;
    Notes notes;
    const XrayImage xray = read_xray_image(image, Beam::kMegavoltage, carm_geometry(image, notes));
    double weight = 0.0;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    const float brightest = *std::ranges::max_element(xray.values.pixels);
    for (int row = 0; row < xray.values.rows; ++row)
      for (int column = 0; column < xray.values.columns; ++column)
        if (xray.values.at(column, row) > 0.3F * brightest) {
          weight += 1.0;
          sum += Eigen::Vector2d(column, row);
        }
    return std::pair(Eigen::Vector2d(sum / weight), xray.view);
  };
  const auto [centered, centered_view] = field_center_px("truebeam-panel-centered.dcm");
  const auto [translated, translated_view] = field_center_px("truebeam-panel-translated.dcm");
  // The content moves by about (-20, +29) mm on the panel: against the panel's motion; rows count downward.
  const Eigen::Vector2d moved_mm =
      0.336 * Eigen::Vector2d(translated.x() - centered.x(), -(translated.y() - centered.y()));
  EXPECT_THAT(moved_mm, VectorNear(Eigen::Vector2d(-20, 29), 3.0));
  // Understood as written, the field is centered on the same axis in both: a wrong sign would tear them 40 mm apart.
  const Eigen::Vector2d off_axis = (centered - centered_view.project(Eigen::Vector3d::Zero()).value()) -
                                   (translated - translated_view.project(Eigen::Vector3d::Zero()).value());
  EXPECT_LT(0.336 * off_axis.norm(), 3.0);
}

}  // namespace
}  // namespace isoshift
