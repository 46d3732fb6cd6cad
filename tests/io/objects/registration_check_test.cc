#include "io/objects/registration_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "geometry/rotation.h"
#include "io/objects/registration_meaning.h"
#include "io/objects/spatial_registration.h"
#include "tests/support/small_study.h"

namespace isoshift::registration_check_test {
namespace {

using testing::HasSubstr;

// An object as isoshift writes it, to be spoiled.
class RegistrationCheckTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    static const SmallStudy small;
    StudyRequest request;
    request.parts.study = small.path();
    Notes notes;
    study_ = new Study(load_study(request, notes, {}));
  }
  static void TearDownTestSuite() { delete study_; }

  RegistrationCheckTest() {
    Notes notes;
    Eigen::Isometry3d actual = study_->planned_room_from_patient;
    actual.pretranslate(Eigen::Vector3d(3.0, -2.0, 1.5));
    actual.prerotate(Eigen::AngleAxisd(rad_from_deg(2.0), Eigen::Vector3d(1, 2, 3).normalized()));
    write_spatial_registration(*study_, actual, {}, path_, notes);
  }

  static DicomItem item(const DicomItem& dataset, std::size_t n) { return dataset.items(DCM_RegistrationSequence)[n]; }
  static DicomItem matrix(const DicomItem& dataset, std::size_t n) {
    return item(dataset, n).items(DCM_MatrixRegistrationSequence)[0].items(DCM_MatrixSequence)[0];
  }
  static void put_matrix(const DicomItem& dataset, std::size_t n, const Eigen::Matrix4d& values) {
    const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = values;
    matrix(dataset, n).put(DCM_FrameOfReferenceTransformationMatrix, std::span(rows.data(), 16));
  }
  Eigen::Matrix4d result() const { return check_registration(path_).registered_from_source->matrix(); }

  // Spoils the object and expects one error, and nothing else, that holds `words`.
  void expect_error(const std::string& words, const std::function<void(DicomItem)>& spoil) {
    edit(path_, spoil);
    const CheckedRegistration checked = check_registration(path_);
    std::vector<std::string> errors;
    for (const RegistrationFinding& finding : checked.findings)
      if (finding.is_error) errors.push_back(finding.text);
    EXPECT_THAT(errors, testing::ElementsAre(HasSubstr(words)));
    EXPECT_TRUE(checked.has_errors());
  }

  static Study* study_;
  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "registration.dcm";
};
Study* RegistrationCheckTest::study_ = nullptr;

TEST_F(RegistrationCheckTest, OursPassesAndSaysItsMatrix) {
  const CheckedRegistration checked = check_registration(path_);
  EXPECT_TRUE(checked.findings.empty()) << checked.findings.front().text;
  EXPECT_EQ(checked.registered_frame_uid, study_->ct->frame_of_reference_uid);
  EXPECT_NE(checked.source_frame_uid, checked.registered_frame_uid);
  EXPECT_TRUE(checked.is_by_isoshift);
  EXPECT_EQ(checked.identity.patient_id, study_->ct->identity.patient_id);
  const SpatialRegistration read = read_spatial_registration(path_);
  EXPECT_EQ(checked.registered_from_source->matrix(), read.items[1].registered_from_source.matrix());
}

TEST_F(RegistrationCheckTest, AScaledRigidMatrixIsFound) {
  Eigen::Matrix4d scaled = result();
  scaled.topLeftCorner<3, 3>() *= 1.3;
  expect_error("item 2: the matrix is not rigid: its columns have the lengths 1.3, 1.3, 1.3",
               [&](DicomItem d) { put_matrix(d, 1, scaled); });
  EXPECT_FALSE(as_rigid(*check_registration(path_).registered_from_source));
}

TEST_F(RegistrationCheckTest, AMirroringMatrixIsFound) {
  Eigen::Matrix4d mirrored = result();
  mirrored.col(0) *= -1.0;
  expect_error("the matrix mirrors", [&](DicomItem d) { put_matrix(d, 1, mirrored); });
}

TEST_F(RegistrationCheckTest, AMatrixThatMovesThePlaneAtInfinityIsFound) {
  Eigen::Matrix4d projective = result();
  projective(3, 0) = 0.1;
  expect_error("the last row", [&](DicomItem d) { put_matrix(d, 1, projective); });
}

TEST_F(RegistrationCheckTest, TwelveNumbersAreNoMatrix) {
  expect_error("has 12 values, expected 16", [&](DicomItem d) {
    matrix(d, 1).put(DCM_FrameOfReferenceTransformationMatrix, R"(1\0\0\1\0\1\0\2\0\0\1\3)");
  });
}

// A number cut to 16 characters may lose its exponent (docs/dicom.md, REG-DS rule).
TEST_F(RegistrationCheckTest, ACutNumberIsNamed) {
  expect_error("holds \"-4.909883469673e\", which is not a finite number", [&](DicomItem d) {
    matrix(d, 1).put(DCM_FrameOfReferenceTransformationMatrix, R"(1\-4.909883469673e\0\0\0\1\0\0\0\0\1\0\0\0\0\1)");
  });
}

TEST_F(RegistrationCheckTest, TheOrderOfTheItemsIsWorthKnowingAndNoError) {
  const Eigen::Matrix4d moved = result();
  edit(path_, [&](DicomItem d) {
    const std::string source = item(d, 1).text(DCM_FrameOfReferenceUID).value();
    put_matrix(d, 1, Eigen::Matrix4d::Identity());
    put_matrix(d, 0, moved);
    item(d, 1).put(DCM_FrameOfReferenceUID, study_->ct->frame_of_reference_uid);
    item(d, 0).put(DCM_FrameOfReferenceUID, source);
  });
  const CheckedRegistration checked = check_registration(path_);
  EXPECT_FALSE(checked.has_errors());
  ASSERT_EQ(checked.findings.size(), 1U);
  EXPECT_THAT(checked.findings[0].text, HasSubstr("item 2, and not the first, is the registered frame"));
  EXPECT_EQ(checked.registered_from_source->matrix(), moved);
}

TEST_F(RegistrationCheckTest, ARegisteredFrameWithoutAnIdentityIsFound) {
  edit(path_, [&](DicomItem d) { item(d, 0).put(DCM_FrameOfReferenceUID, "1.2.3.4"); });
  std::string errors;
  for (const RegistrationFinding& finding : check_registration(path_).findings)
    if (finding.is_error) errors += finding.text + "\n";
  EXPECT_THAT(errors, HasSubstr("no item is the registered frame with an identity"));
}

// A DS has 16 characters, and programs that multiply matrices round.
TEST_F(RegistrationCheckTest, AnIdentityIsOneButForRounding) {
  Eigen::Matrix4d identity = Eigen::Matrix4d::Identity();
  identity(0, 3) = 1e-7;
  identity(1, 0) = -1e-7;
  const Eigen::Matrix4d moved = result();
  edit(path_, [&](DicomItem d) { put_matrix(d, 0, identity); });
  const CheckedRegistration checked = check_registration(path_);
  EXPECT_FALSE(checked.has_errors());
  ASSERT_EQ(checked.findings.size(), 1U);
  EXPECT_THAT(checked.findings[0].text, HasSubstr("item 1: is the identity but for rounding"));
  EXPECT_EQ(checked.registered_from_source->matrix(), moved);
  identity(0, 3) = 0.01;
  edit(path_, [&](DicomItem d) { put_matrix(d, 0, identity); });
  EXPECT_THAT(check_registration(path_).findings.front().text, HasSubstr("item 1: moves the registered frame"));
}

TEST_F(RegistrationCheckTest, AFrameMovedAgainstItselfIsFound) {
  expect_error("item 2: moves the registered frame against itself",
               [](DicomItem d) { item(d, 1).put(DCM_FrameOfReferenceUID, study_->ct->frame_of_reference_uid); });
}

// Programs that take one item each would place the patient differently.
TEST_F(RegistrationCheckTest, ItemsThatContradictEachOtherAreFound) {
  const auto third_item = [](DicomItem d, const std::string& frame) {
    DicomItem third = d.append_item(DCM_RegistrationSequence);
    third.put(DCM_FrameOfReferenceUID, frame);
    DicomItem identity = third.append_item(DCM_MatrixRegistrationSequence).append_item(DCM_MatrixSequence);
    identity.put(DCM_FrameOfReferenceTransformationMatrix, R"(1\0\0\0\0\1\0\0\0\0\1\0\0\0\0\1)");
    identity.put(DCM_FrameOfReferenceTransformationMatrixType, "RIGID");
  };
  const auto before = folder_ / "before.dcm";
  std::filesystem::copy_file(path_, before);
  const auto start_again = [&] {
    std::filesystem::copy_file(before, path_, std::filesystem::copy_options::overwrite_existing);
  };
  expect_error("item 3: gives the frame",
               [&](DicomItem d) { third_item(d, item(d, 1).text(DCM_FrameOfReferenceUID).value()); });
  EXPECT_FALSE(check_registration(path_).registered_from_source);
  start_again();
  expect_error("item 3: says that the room (IEC 61217 Fixed) is the registered frame",
               [&](DicomItem d) { third_item(d, kIecFixedFrameUid); });
  start_again();
  expect_error("it registers several frames, one of them by an identity", [&](DicomItem d) { third_item(d, "1.2.3"); });
  EXPECT_FALSE(check_registration(path_).registered_from_source);
  start_again();
  expect_error("item 2: gives the image", [&](DicomItem d) {
    const DicomItem image = item(d, 0).items(DCM_ReferencedImageSequence)[0];
    item(d, 1).append_reference(DCM_ReferencedImageSequence, image.required_text(DCM_ReferencedSOPClassUID),
                                image.required_text(DCM_ReferencedSOPInstanceUID));
  });
}

TEST_F(RegistrationCheckTest, SeveralMatricesInAnItemAreComposedAndFound) {
  const Eigen::Matrix4d once = result();
  expect_error("SlicerRT multiplies them the other way", [&](DicomItem d) {
    DicomItem more = item(d, 1).items(DCM_MatrixRegistrationSequence)[0].append_item(DCM_MatrixSequence);
    const std::array<double, 16> shift = {1, 0, 0, 10, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    more.put(DCM_FrameOfReferenceTransformationMatrix, shift);
    more.put(DCM_FrameOfReferenceTransformationMatrixType, "RIGID");
  });
  EXPECT_NEAR(result()(0, 3), once(0, 3) + 10.0, 1e-9);  // the first one is applied first
}

TEST_F(RegistrationCheckTest, AMissingReferenceIsNamed) {
  const std::string lost = study_->ct->sop_instance_uids.front();
  expect_error("the first one " + lost, [&](DicomItem d) {
    for (const DicomItem& series : d.items(DCM_ReferencedSeriesSequence))
      for (DicomItem instance : series.items(DCM_ReferencedInstanceSequence))
        if (instance.text(DCM_ReferencedSOPInstanceUID) == lost) instance.put(DCM_ReferencedSOPInstanceUID, "1.2.3");
  });
}

TEST_F(RegistrationCheckTest, MissingAndMalformedAttributesAreNamed) {
  expect_error("ContentLabel (0070,0080) is missing", [](DicomItem d) { d.erase(DCM_ContentLabel); });
  edit(path_, [](DicomItem d) { d.put(DCM_ContentLabel, "SETUP"); });
  expect_error("\"1.02.3\", which is not a UID", [](DicomItem d) { d.put(DCM_SOPInstanceUID, "1.02.3"); });
  edit(path_, [](DicomItem d) { d.put(DCM_SOPInstanceUID, "1.2.3"); });
  expect_error("expected RIGID",
               [](DicomItem d) { matrix(d, 1).put(DCM_FrameOfReferenceTransformationMatrixType, "AFFINE"); });
}

TEST_F(RegistrationCheckTest, OtherObjectsAreRefused) { EXPECT_THROW(check_registration(study_->plan->path), Error); }

// PS3.17 O.1: without a frame the matrix counts on the plane of the images, where no isocenter can lie.
TEST_F(RegistrationCheckTest, NoIsocenterIsPlacedWhereNoFrameIsNamed) {
  edit(path_, [](DicomItem d) {
    d.put(DCM_Manufacturer, "Somebody");
    item(d, 1).erase(DCM_FrameOfReferenceUID);
    const DicomItem image = item(d, 0).items(DCM_ReferencedImageSequence)[0];
    item(d, 1).append_reference(DCM_ReferencedImageSequence, image.required_text(DCM_ReferencedSOPClassUID), "1.2.3");
    DicomItem instance = d.items(DCM_ReferencedSeriesSequence)[0].append_item(DCM_ReferencedInstanceSequence);
    instance.put(DCM_ReferencedSOPInstanceUID, "1.2.3");
  });
  CheckedRegistration checked = check_registration(path_);
  ASSERT_FALSE(checked.has_errors());
  EXPECT_FALSE(meaning_of(checked, std::nullopt, Eigen::Vector3d(1, 2, 3)).registered_from_isocenter);
  ASSERT_TRUE(checked.has_errors());
  EXPECT_THAT(checked.findings.back().text, HasSubstr("names no FrameOfReferenceUID (0020,0052)"));
}

TEST_F(RegistrationCheckTest, AnInverseIsFoundWhereverTheSourceFrameBegins) {
  edit(path_, [](DicomItem d) { d.put(DCM_Manufacturer, "Somebody"); });
  const auto inverse = folder_ / "inverse.dcm";
  std::filesystem::copy_file(path_, inverse);
  edit(inverse, [&](DicomItem d) { put_matrix(d, 1, result().inverse()); });
  CheckedRegistration checked = check_registration(path_), inverted = check_registration(inverse);
  const Eigen::Vector3d isocenter(20.0, -50.0, 60.0);
  const RegistrationMeaning meaning = meaning_of(checked, std::nullopt, isocenter),
                            inverted_meaning = meaning_of(inverted, std::nullopt, isocenter);
  EXPECT_TRUE(compare(checked, meaning, inverted, inverted_meaning).difference.value().other_is_inverted);
  EXPECT_FALSE(compare(checked, meaning, checked, meaning).difference.value().other_is_inverted);
}

TEST_F(RegistrationCheckTest, AnObjectThatMovesTheCtIsSaid) {
  edit(path_, [&](DicomItem d) {
    d.put(DCM_FrameOfReferenceUID, "1.2.3.9");
    item(d, 0).put(DCM_FrameOfReferenceUID, "1.2.3.9");
    item(d, 1).put(DCM_FrameOfReferenceUID, study_->ct->frame_of_reference_uid);
  });
  CheckedRegistration checked = check_registration(path_);
  const PlannedSetup setup{.plan = study_->plan};
  EXPECT_FALSE(meaning_of(checked, setup, Eigen::Vector3d::Zero()).couch_shift);
  ASSERT_TRUE(checked.has_errors());
  EXPECT_THAT(std::ranges::find_if(checked.findings, &RegistrationFinding::is_error)->text,
              HasSubstr("it registers the other way around"));
}

TEST(RegistrationDifference, IsWhereTheIsocentersLieAndHowTheyAreTurned) {
  Eigen::Isometry3d a = Eigen::Isometry3d::Identity(), b = a;
  a.translate(Eigen::Vector3d(100.0, -50.0, 300.0));
  b.translate(Eigen::Vector3d(101.0, -52.0, 302.0));
  b.rotate(Eigen::AngleAxisd(rad_from_deg(2.0), Eigen::Vector3d::UnitZ()));
  const RegistrationDifference difference = difference_between(a, b, b.inverse());
  EXPECT_NEAR(difference.translation_mm, 3.0, 1e-9);
  EXPECT_NEAR(difference.angle_rad, rad_from_deg(2.0), 1e-9);
  EXPECT_FALSE(difference.other_is_inverted);
  EXPECT_TRUE(difference_between(a, b.inverse(), b).other_is_inverted);
}

}  // namespace
}  // namespace isoshift::registration_check_test
