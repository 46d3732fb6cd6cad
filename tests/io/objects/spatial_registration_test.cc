#include "io/objects/spatial_registration.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "setup/couch_shift.h"
#include "tests/support/command.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"

namespace isoshift::spatial_registration_test {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

const Vector3d kIsocenter(10, -150, -420);

Eigen::Isometry3d matrix_of(PatientPosition position, const Eigen::Matrix3d& rotation) {
  const Eigen::Isometry3d planned = planned_room_from_patient(position, {}, kIsocenter);
  Eigen::Isometry3d error = Eigen::Isometry3d::Identity();
  error.linear() = rotation;
  error.translation() = Vector3d(3, -2, 1.5);
  return ct_from_treatment(planned, error * planned);
}

// The vectors of docs/dicom.md 4.4.
TEST(SpatialRegistration, MatrixIsThatOfDicomMd44) {
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  EXPECT_THAT(Vector3d(matrix_of(PatientPosition::kHfs, identity).translation()),
              VectorNear(Vector3d(7, -148.5, -418), 1e-9));
  EXPECT_THAT(Vector3d(matrix_of(PatientPosition::kFfs, identity).translation()),
              VectorNear(Vector3d(13, -148.5, -422), 1e-9));
  EXPECT_THAT(Vector3d(matrix_of(PatientPosition::kHfp, identity).translation()),
              VectorNear(Vector3d(13, -151.5, -418), 1e-9));
  Eigen::Matrix<double, 3, 4> expected;
  expected << 0.999752, 0.013962, 0.017329, 7.056343, -0.013808, 0.999864, -0.008968, -148.476716, -0.017452, 0.008727,
      0.99981, -417.934936;
  const Eigen::Matrix3d rotation = rotation_from_zxy({rad_from_deg(1), rad_from_deg(-0.5), rad_from_deg(0.8)});
  EXPECT_THAT(Eigen::MatrixXd(matrix_of(PatientPosition::kHfs, rotation).matrix().topRows<3>()),
              VectorNear(Eigen::MatrixXd(expected), 6e-7));
}

class SpatialRegistrationFileTest : public testing::Test {
 protected:
  Study load() {
    StudyRequest request;
    request.parts.study = small_.path();
    return load_study(request, notes_, {});
  }

  // Writes the registration of the phantom's true pose.
  SpatialRegistration write_truth(const Study& study) {
    actual_ = truth() * study.planned_room_from_patient;
    write_spatial_registration(study, actual_, {}, path(), notes_);
    return read_spatial_registration(path());
  }

  Eigen::Isometry3d truth() const {
    const Placement placement = small_phantom().placement;
    Eigen::Isometry3d error = Eigen::Isometry3d::Identity();
    error.linear() = placement.rotation();
    error.translation() = placement.translation_mm;
    return error;
  }

  std::filesystem::path path() const { return small_.path() / "reg.dcm"; }

  SmallStudy small_;
  Notes notes_;
  Eigen::Isometry3d actual_;
};

TEST_F(SpatialRegistrationFileTest, HoldsAnExactIdentityAndTheTreatmentMatrix) {
  const Study study = load();
  const SpatialRegistration registration = write_truth(study);
  ASSERT_EQ(registration.items.size(), 2U);
  EXPECT_EQ(registration.frame_of_reference_uid, study.ct->frame_of_reference_uid);
  EXPECT_EQ(registration.items[0].frame_of_reference_uid, study.ct->frame_of_reference_uid);
  EXPECT_EQ(registration.items[0].registered_from_source.matrix(), Eigen::Matrix4d::Identity());
  EXPECT_NE(registration.items[1].frame_of_reference_uid, study.ct->frame_of_reference_uid);

  // M (0, 0, 0) is the CT point now at the machine's isocenter; M^-1 isocenter is the setup error in patient axes.
  const Eigen::Isometry3d& m = registration.items[1].registered_from_source;
  EXPECT_THAT(Vector3d(actual_ * (m * Vector3d::Zero())), VectorNear(Vector3d::Zero().eval(), 1e-6));
  const Vector3d error_patient = m.inverse() * study.isocenter_patient_mm;
  EXPECT_THAT(Vector3d(study.planned_room_from_patient.linear() * error_patient),
              VectorNear(Vector3d(truth().translation()), 1e-6));

  EXPECT_THAT(actual_room_from_patient(study.planned_room_from_patient, m), PoseNear(actual_, 1e-6, 1e-6));

  // The inverse on the way back would fail this.
  const Vector3d inverted = m * study.isocenter_patient_mm;
  EXPECT_GT((study.planned_room_from_patient.linear() * inverted - truth().translation()).norm(), 100.0);
}

// docs/dicom.md 4.4, --source-for iec-fixed: from the room's axes, the inverse of the pose.
TEST_F(SpatialRegistrationFileTest, FromTheRoomItIsTheInverseOfThePose) {
  const Study study = load();
  const Eigen::Isometry3d actual = truth() * study.planned_room_from_patient;
  write_spatial_registration(study, actual, {.source = RegistrationSource::kIecFixed}, path(), notes_);
  const SpatialRegistration::Item item = read_spatial_registration(path()).items[1];
  EXPECT_EQ(item.frame_of_reference_uid, "1.2.840.10008.1.4.3.1");
  EXPECT_THAT(item.registered_from_source, PoseNear(actual.inverse(), 1e-6, 1e-6));
  const CommandOutcome checked = run_shell("dciodvfy -new " + path().string());
  EXPECT_THAT(checked.out, testing::Not(HasSubstr("Error"))) << checked.out;
}

TEST_F(SpatialRegistrationFileTest, PassesDciodvfy) {
  write_truth(load());
  const CommandOutcome checked = run_shell("dciodvfy -new " + path().string());
  EXPECT_EQ(checked.exit_status, 0) << checked.out;
  EXPECT_THAT(checked.out, HasSubstr("SpatialRegistration"));
  EXPECT_THAT(checked.out, testing::Not(HasSubstr("Error"))) << checked.out;
}

TEST_F(SpatialRegistrationFileTest, PassesDciodvfyWithoutABodyPart) {
  Study study = load();
  CtSeries without = *study.ct;
  without.body_part_examined.clear();
  study.ct = std::make_shared<const CtSeries>(std::move(without));
  write_truth(study);
  const CommandOutcome checked = run_shell("dciodvfy -new " + path().string());
  EXPECT_THAT(checked.out, testing::Not(HasSubstr("Error"))) << checked.out;
}

TEST_F(SpatialRegistrationFileTest, PydicomRecoversTheSetupError) {
  const Study study = load();
  write_truth(study);
  const CommandOutcome read =
      run_shell("/usr/bin/python3 " + std::string(ISOSHIFT_SOURCE_DIR) + "/tests/io/objects/check_registration.py " +
                path().string() + " " + small_.truth().string());
  EXPECT_EQ(read.exit_status, 0) << read.out;
}

TEST_F(SpatialRegistrationFileTest, FrameOfImagesWithIsocenterIsUsedAndListed) {
  for (const int n : {0, 1}) edit(small_.image(n), [](DicomItem d) { d.put(DCM_IsocenterPosition, "9\\-150\\-251"); });
  const Study study = load();
  const SpatialRegistration registration = write_truth(study);
  EXPECT_EQ(registration.items[1].frame_of_reference_uid, study.rt_images[0].frame_of_reference_uid);
  // The image frame's isocenter lands where the treatment frame's origin does.
  EXPECT_THAT(Vector3d(actual_ * (registration.items[1].registered_from_source * Vector3d(9, -150, -251))),
              VectorNear(Vector3d::Zero().eval(), 1e-6));
  const DicomFile file = DicomFile::read(path(), DicomFile::Extent::kWhole);
  EXPECT_EQ(file.dataset().items(DCM_RegistrationSequence)[1].items(DCM_ReferencedImageSequence).size(), 2U);
}

TEST_F(SpatialRegistrationFileTest, ImageFrameExampleOfDicomMd44) {
  Eigen::Isometry3d m = matrix_of(PatientPosition::kHfs, Eigen::Matrix3d::Identity());
  m.translate(-Vector3d(9, -150, -251));
  EXPECT_THAT(Vector3d(m.translation()), VectorNear(Vector3d(-2, 1.5, -167), 1e-9));
}

TEST_F(SpatialRegistrationFileTest, TheCtsOwnFrameIsReplacedWithAWarning) {
  Study study = load();
  for (RtImage& image : study.rt_images) image.frame_of_reference_uid = study.ct->frame_of_reference_uid;
  const SpatialRegistration registration = write_truth(study);
  EXPECT_NE(registration.items[1].frame_of_reference_uid, study.ct->frame_of_reference_uid);
  EXPECT_THAT(notes_.warnings, testing::Contains(HasSubstr("would claim a perfect setup")));
}

TEST_F(SpatialRegistrationFileTest, EveryReferencedInstanceIsListedUnderItsStudyAndSeries) {
  Study study = load();
  study.rt_images[1].identity.study_instance_uid = "1.2.3.4";
  study.rt_images[1].series_instance_uid = "1.2.3.4.5";
  write_truth(study);
  const DicomFile file = DicomFile::read(path(), DicomFile::Extent::kWhole);
  const DicomItem d = file.dataset();
  const auto same_study = d.items(DCM_ReferencedSeriesSequence);
  ASSERT_EQ(same_study.size(), 2U);  // the CT, and the X-ray of the CT's study
  EXPECT_EQ(same_study[0].items(DCM_ReferencedInstanceSequence).size(), study.ct->sop_instance_uids.size());
  EXPECT_EQ(same_study[1].items(DCM_ReferencedInstanceSequence).size(), 1U);
  const auto others = d.items(DCM_StudiesContainingOtherReferencedInstancesSequence);
  ASSERT_EQ(others.size(), 1U);
  EXPECT_EQ(others[0].text(DCM_StudyInstanceUID), "1.2.3.4");
  EXPECT_EQ(others[0].items(DCM_ReferencedSeriesSequence)[0].items(DCM_ReferencedInstanceSequence).size(), 1U);
}

TEST_F(SpatialRegistrationFileTest, ReaderRefusesAScaledMatrix) {
  write_truth(load());
  edit(path(), [](DicomItem d) {
    d.items(DCM_RegistrationSequence)[1].items(DCM_MatrixRegistrationSequence)[0].items(DCM_MatrixSequence)[0].put(
        DCM_FrameOfReferenceTransformationMatrix, "1.3\\0\\0\\0\\0\\1.3\\0\\0\\0\\0\\1.3\\0\\0\\0\\0\\1");
  });
  EXPECT_THROW(read_spatial_registration(path()), Error);
}

// The other rows of the table of docs/dicom.md 4.4: a frame of its own, and the images in the General Reference.
TEST_F(SpatialRegistrationFileTest, ImagesThatAgreeOnNoFrameGetANewOneOfDicomMd44) {
  const auto expect_new_frame = [&](const std::function<void(RtImage&)>& change) {
    Study study = load();
    change(study.rt_images[1]);
    std::filesystem::remove(path());
    const SpatialRegistration registration = write_truth(study);
    const std::string& frame = registration.items[1].frame_of_reference_uid;
    EXPECT_NE(frame, study.ct->frame_of_reference_uid);
    for (const RtImage& image : study.rt_images) EXPECT_NE(frame, image.frame_of_reference_uid);
    EXPECT_THAT(Vector3d(actual_ * (registration.items[1].registered_from_source * Vector3d::Zero())),
                VectorNear(Vector3d::Zero().eval(), 1e-6));
    const DicomFile file = DicomFile::read(path(), DicomFile::Extent::kWhole);
    EXPECT_TRUE(file.dataset().items(DCM_RegistrationSequence)[1].items(DCM_ReferencedImageSequence).empty());
    EXPECT_EQ(file.dataset().items(DCM_ReferencedImageSequence).size(), 2U);
  };
  for (const int n : {0, 1}) edit(small_.image(n), [](DicomItem d) { d.put(DCM_IsocenterPosition, "9\\-150\\-251"); });
  expect_new_frame([](RtImage& image) { image.isocenter_mm.reset(); });
  expect_new_frame([](RtImage& image) { image.frame_of_reference_uid.reset(); });
  expect_new_frame([](RtImage& image) { image.frame_of_reference_uid = "1.2.3"; });
  expect_new_frame([](RtImage& image) { image.isocenter_mm->x() += 1.0; });
}

}  // namespace
}  // namespace isoshift::spatial_registration_test
