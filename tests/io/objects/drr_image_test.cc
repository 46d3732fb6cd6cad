#include "io/objects/drr_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "io/dicom/decode.h"
#include "tests/support/small_study.h"

namespace isoshift::drr_image_test {
namespace {

using testing::HasSubstr;

class DrrImageTest : public testing::Test {
 protected:
  CommandOutcome render(const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments = {"drr",     study_.path().string(), "-o", study_.output().string(),
                                          "--dicom", "--renderer",           "cpu"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_command(arguments);
  }
  std::filesystem::path drr(int n) const { return study_.output() / ("drr" + std::to_string(n) + ".dcm"); }

  SmallStudy study_;
  Notes notes_;
};

TEST_F(DrrImageTest, PassesDciodvfy) {
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{}, {"--overwrite", "--setup-error", study_.truth().string()}}) {
    ASSERT_EQ(render(more).exit_status, 0);
    const CommandOutcome checked = run_shell("dciodvfy -new " + drr(1).string());
    EXPECT_THAT(checked.out, HasSubstr("RTImage"));
    EXPECT_THAT(checked.out, testing::Not(HasSubstr("Error"))) << checked.out;
  }
}

TEST_F(DrrImageTest, HasTheGeometryOfItsXray) {
  edit(study_.image(1), [](DicomItem d) {
    d.put(DCM_XRayImageReceptorTranslation, "3\\-2\\-500");
    d.put(DCM_XRayImageReceptorAngle, 5.0);
    d.put(DCM_TableTopPitchAngle, 1.5);
  });
  edit(study_.image(0), [](DicomItem d) { d.put(DCM_TableTopPitchAngle, 1.5); });
  ASSERT_EQ(render().exit_status, 0);
  const RtImage of_drr = read_rt_images(drr(2), notes_).front();
  const RtImage of_xray = read_rt_images(study_.image(1), notes_).front();
  EXPECT_TRUE(xray_view(of_drr, Beam::kKilovoltage, notes_)
                  .pixel_from_room.isApprox(xray_view(of_xray, Beam::kKilovoltage, notes_).pixel_from_room, 1e-9));
  EXPECT_NEAR(table_angles(std::span(&of_drr, 1), notes_).pitch_rad,
              table_angles(std::span(&of_xray, 1), notes_).pitch_rad, 1e-7);
  EXPECT_EQ(of_drr.image_type, "DRR");
  EXPECT_EQ(of_drr.plan_sop_instance_uid, of_xray.plan_sop_instance_uid);
}

TEST_F(DrrImageTest, HoldsLineIntegralsInThousandths) {
  ASSERT_EQ(render().exit_status, 0);
  const RtImage image = read_rt_images(drr(1), notes_).front();
  const XrayImage read = read_xray_image(DicomFile::read(image.path, DicomFile::Extent::kWhole), image,
                                         xray_view(image, Beam::kKilovoltage, notes_));
  EXPECT_EQ(read.meaning, XrayImage::Meaning::kLineIntegral);
  EXPECT_EQ(read.values.at(0, 0), 0.0F);    // air
  EXPECT_GT(read.values.at(48, 48), 2.0F);  // a head
  EXPECT_LT(read.values.at(48, 48), 8.0F);
}

TEST_F(DrrImageTest, IsInTheFrameOfTheCtOnlyAsPlanned) {
  ASSERT_EQ(render().exit_status, 0);
  const RtImage planned = read_rt_images(drr(1), notes_).front();
  const DicomFile ct = DicomFile::read(study_.ct_slice(0), DicomFile::Extent::kHeader);
  EXPECT_EQ(planned.frame_of_reference_uid, ct.dataset().text(DCM_FrameOfReferenceUID));
  EXPECT_NE(planned.isocenter_mm, Eigen::Vector3d(0.0, 0.0, 0.0));
  ASSERT_EQ(render({"--overwrite", "--setup-error", study_.truth().string()}).exit_status, 0);
  const RtImage off = read_rt_images(drr(1), notes_).front();
  EXPECT_NE(off.frame_of_reference_uid, planned.frame_of_reference_uid);
  EXPECT_EQ(off.isocenter_mm, Eigen::Vector3d(0.0, 0.0, 0.0));  // the origin of its frame
}

TEST_F(DrrImageTest, LabelsAreCutBetweenCharacters) {
  edit(study_.image(0), [](DicomItem d) {
    d.put(DCM_SpecificCharacterSet, "ISO_IR 192");
    d.put(DCM_RTImageLabel,
          "Sch\xC3\xA4"
          "del von vorn \xC3\x84\xC3\x96");  // 18 characters
  });
  ASSERT_EQ(render().exit_status, 0);
  EXPECT_EQ(DicomFile::read(drr(1), DicomFile::Extent::kHeader).dataset().text(DCM_RTImageLabel),
            "Sch\xC3\xA4"
            "del von vorn");
}

// A DRR in an X-ray's place is refused, and registers at its own pose where that is allowed.
TEST_F(DrrImageTest, IsRefusedAsAnXrayUnlessAllowed) {
  ASSERT_EQ(render().exit_status, 0);
  const std::vector<std::string> with_drrs = {"--image", drr(1).string(), "--image", drr(2).string()};
  SmallStudy other;
  const CommandOutcome refused = register_study(other, with_drrs);
  EXPECT_EQ(refused.exit_status, 1);
  EXPECT_THAT(refused.err, HasSubstr("says DRR: this is not an X-ray"));
}

}  // namespace
}  // namespace isoshift::drr_image_test
