#include "io/dicom/rt_structures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>

#include "base/error.h"
#include "io/study/study.h"
#include "tests/support/pose_near.h"
#include "tests/support/small_study.h"

namespace isoshift::rt_structures_test {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

class RtStructuresTest : public testing::Test {
 protected:
  RtStructures read(const std::vector<DrawnStructure>& structures) {
    draw(study_, structures);
    return read_rt_structures(study_.structures());
  }

  void change_contour(const std::function<void(DicomItem contour)>& change) {
    edit(study_.structures(), [&](const DicomItem& d) {
      change(d.items(DCM_ROIContourSequence).front().items(DCM_ContourSequence).front());
    });
  }

  std::string error_of_reading() {
    try {
      read_rt_structures(study_.structures());
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  std::string error_of_naming(const RtStructures& structures, std::string_view name) {
    try {
      structure_named(structures, name);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  // Loading the study with what a person allows; the notes of it, or its error as a warning.
  Notes notes_of_loading(const Allowances& allowed = {}) {
    Notes notes;
    StudyRequest request;
    request.parts.study = study_.path();
    request.allowed = allowed;
    try {
      load_study(request, notes, {});
    } catch (const Error& error) {
      notes.warnings.emplace_back(error.what());
    }
    return notes;
  }

  SmallStudy study_;
  const std::vector<Eigen::Vector3d> square_ = rectangle({0, 40, -400}, 20, 20);
};

TEST_F(RtStructuresTest, ReadsNumberNameTypeFrameAndContours) {
  const RtStructures structures = read({{"Spine", {square_, rectangle({0, 40, -397}, 20, 10)}}, {"Cord", {square_}}});
  EXPECT_EQ(structures.label, "DRAWN");
  EXPECT_EQ(structures.identity.patient_id, "PHANTOM1");
  ASSERT_EQ(structures.structures.size(), 2U);
  const Structure& spine = structures.structures.front();
  EXPECT_EQ(spine.number, 1);
  EXPECT_EQ(spine.name, "Spine");
  EXPECT_EQ(spine.interpreted_type, "ORGAN");
  EXPECT_EQ(spine.frame_of_reference_uid, read_rt_plan(study_.plan()).frame_of_reference_uid);
  ASSERT_EQ(spine.contours.size(), 2U);
  EXPECT_THAT(spine.contours[1].points_patient_mm[2], VectorNear(Eigen::Vector3d(10, 45, -397), 1e-12));
  EXPECT_EQ(spine.contours[1].slab_thickness_mm, std::nullopt);
}

TEST_F(RtStructuresTest, ASlabThicknessCountsWhereItIsOne) {
  draw(study_, {{"Spine", {square_}}});
  change_contour([](DicomItem contour) { contour.put(DCM_RETIRED_ContourSlabThickness, 2.5); });
  EXPECT_EQ(read_rt_structures(study_.structures()).structures[0].contours[0].slab_thickness_mm, 2.5);
  change_contour([](DicomItem contour) { contour.put(DCM_RETIRED_ContourSlabThickness, 0.0); });
  EXPECT_EQ(read_rt_structures(study_.structures()).structures[0].contours[0].slab_thickness_mm, std::nullopt);
}

TEST_F(RtStructuresTest, ClosedPlanarXorIsClosedToo) {
  EXPECT_EQ(read({{"Ring", {square_}, "CLOSEDPLANAR_XOR"}}).structures[0].contours.size(), 1U);
}

TEST_F(RtStructuresTest, WhatEnclosesNothingIsCountedAndNotUsed) {
  const RtStructures structures = read({{"Marker", {{{1, 2, 3}}}, "POINT"}, {"Line", {{{1, 2, 3}, {4, 5, 3}}}}});
  EXPECT_EQ(structures.structures[0].ignored_contours, 1);
  EXPECT_EQ(structures.structures[1].ignored_contours, 1);
  EXPECT_THAT(
      error_of_naming(structures, "Marker"),
      HasSubstr("structure 1 \"Marker\" has no closed contour (ContourGeometricType (3006,0042) CLOSED_PLANAR)"));
}

// A DS value with a 16-bit length ends at 65534 bytes: longer ones are written as UN (PS3.5 6.2.2).
TEST_F(RtStructuresTest, ALongContourWrittenAsUnknownIsRead) {
  constexpr int kPoints = 6000;
  std::vector<Eigen::Vector3d> circle;
  circle.reserve(kPoints);
  for (int n = 0; n < kPoints; ++n)
    circle.emplace_back(35.123 * std::cos(2 * M_PI * n / kPoints), 35.123 * std::sin(2 * M_PI * n / kPoints), -400);
  const RtStructures structures = read({{"Spine", {circle}}});
  std::ifstream stream(study_.structures(), std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
  EXPECT_THAT(bytes, HasSubstr("\x06\x30\x50" + std::string(1, '\0') + "UN"));
  ASSERT_EQ(structures.structures[0].contours.size(), 1U);
  const auto& points_mm = structures.structures[0].contours[0].points_patient_mm;
  ASSERT_EQ(points_mm.size(), circle.size());
  EXPECT_THAT(points_mm.back(), VectorNear(circle.back(), 1e-9));
}

TEST_F(RtStructuresTest, CoordinatesThatDoNotMatchTheirCountAreRefused) {
  draw(study_, {{"Spine", {square_}}});
  change_contour([](DicomItem contour) { contour.put(DCM_NumberOfContourPoints, 5.0); });
  EXPECT_THAT(error_of_reading(),
              HasSubstr("ContourSequence (3006,0040) item 1: ContourData (3006,0050) has 12 values, "
                        "expected 3 for each of 5 points (NumberOfContourPoints (3006,0046))"));
  change_contour([](DicomItem contour) {
    contour.erase(DCM_NumberOfContourPoints);
    contour.put(DCM_ContourData, "1\\2\\3\\4\\5\\6\\7\\8\\9\\10");
  });
  EXPECT_THAT(error_of_reading(), HasSubstr("ContourData (3006,0050) has 10 values"));
  change_contour([](DicomItem contour) { contour.put(DCM_ContourData, "1\\2\\nan"); });
  EXPECT_THAT(error_of_reading(), HasSubstr("holds \"nan\", which is not a finite number"));
}

TEST_F(RtStructuresTest, NumbersThatDoNotTellWhatIsMeantAreRefused) {
  draw(study_, {{"Spine", {square_}}, {"Cord", {square_}}});
  edit(study_.structures(),
       [](const DicomItem& d) { d.items(DCM_ROIContourSequence)[1].put(DCM_ReferencedROINumber, 7.0); });
  EXPECT_THAT(error_of_reading(), HasSubstr("ROIContourSequence (3006,0039) item 2: ReferencedROINumber (3006,0084) is "
                                            "7, a number that no item of StructureSetROISequence (3006,0020) has"));
  edit(study_.structures(),
       [](const DicomItem& d) { d.items(DCM_ROIContourSequence)[1].put(DCM_ReferencedROINumber, 1.0); });
  EXPECT_THAT(error_of_reading(), HasSubstr("ReferencedROINumber (3006,0084) is 1, as in an earlier item"));
  edit(study_.structures(),
       [](const DicomItem& d) { d.items(DCM_StructureSetROISequence)[1].put(DCM_ROINumber, 1.0); });
  EXPECT_THAT(error_of_reading(), HasSubstr("ROINumber (3006,0022) is 1, as in an earlier item"));
}

TEST_F(RtStructuresTest, ObservationsOfOneStructureMustAgree) {
  draw(study_, {{"Spine", {square_}}});
  const auto observe = [&](const char* type) {
    edit(study_.structures(), [type](DicomItem d) {
      DicomItem observation = d.append_item(DCM_RTROIObservationsSequence);
      observation.put(DCM_ReferencedROINumber, 1.0);
      observation.put(DCM_RTROIInterpretedType, type);
    });
  };
  observe("");
  observe("ORGAN");
  EXPECT_EQ(read_rt_structures(study_.structures()).structures.front().interpreted_type, "ORGAN");
  observe("EXTERNAL");
  EXPECT_THAT(error_of_reading(), HasSubstr("RTROIInterpretedType (3006,00A4) of structure 1 \"Spine\" is EXTERNAL, "
                                            "and ORGAN in an earlier item"));
}

TEST_F(RtStructuresTest, MoreStructuresThanAnyFileNeedsAreRefused) {
  draw(study_, std::vector<DrawnStructure>(1001, {"Spine", {}}));
  EXPECT_THAT(error_of_reading(), HasSubstr("more than 1000 structures"));
}

TEST_F(RtStructuresTest, NamesAreFoundAsSpeltElseInOtherCase) {
  const RtStructures structures = read({{"Spine", {square_}}, {"SPINE", {square_}}, {"Cord", {square_}}});
  EXPECT_EQ(structure_named(structures, "SPINE").number, 2);
  EXPECT_EQ(structure_named(structures, "cord").number, 3);
  EXPECT_EQ(
      error_of_naming(structures, "spine"),
      study_.structures().string() +
          ": 2 structures named \"spine\" (ROIName (3006,0026)), expected one.\n"
          "       There are: \"Spine\", \"SPINE\", \"Cord\".\n       Names must differ: rename one in the planning "
          "system");
  EXPECT_THAT(error_of_naming(structures, "Spin"), HasSubstr("no structure named \"Spin\""));
}

TEST_F(RtStructuresTest, AStudyHasTheStructuresInItsFolder) {
  EXPECT_THAT(notes_of_loading().warnings, testing::IsEmpty());
  draw(study_, {{"Spine", {square_}}});
  Notes notes;
  StudyRequest request;
  request.parts.study = study_.path();
  const Study study = load_study(request, notes, {});
  ASSERT_TRUE(study.structures);
  EXPECT_EQ(structure_named(*study.structures, "Spine").contours.size(), 1U);
}

TEST_F(RtStructuresTest, StructuresInAnotherFrameOfReferenceAreRefusedUnlessAllowed) {
  draw(study_, {{"Spine", {square_}}, {"Cord", {square_}}});
  edit(study_.plan(), [&](DicomItem d) {
    DicomItem reference = d.append_item(DCM_ReferencedStructureSetSequence);
    reference.put(DCM_ReferencedSOPInstanceUID, "1.2.3.4");
  });
  edit(study_.structures(), [](const DicomItem& d) {
    d.items(DCM_StructureSetROISequence)[1].put(DCM_ReferencedFrameOfReferenceUID, "1.2.3");
  });
  EXPECT_THAT(notes_of_loading().warnings,
              ElementsAre(study_.structures().string() +
                          ": ReferencedFrameOfReferenceUID (3006,0024) of \"Cord\" is not that of the CT, so they do "
                          "not apply to it\n"
                          "       If that is known to be right, allow it: --allow for-mismatch=REASON"));
  EXPECT_THAT(notes_of_loading({{"for-mismatch", "known"}}).overrides, Contains(HasSubstr("of \"Cord\"")));
  edit(study_.structures(),
       [](const DicomItem& d) { d.items(DCM_StructureSetROISequence)[1].erase(DCM_ReferencedFrameOfReferenceUID); });
  EXPECT_THAT(notes_of_loading().warnings,
              ElementsAre("structures \"Cord\" have no ReferencedFrameOfReferenceUID (3006,0024); taken as that of the "
                          "CT"));
}

TEST_F(RtStructuresTest, StructuresOfAnotherPatientAreRefused) {
  draw(study_, {{"Spine", {square_}}});
  edit(study_.structures(), [](DicomItem d) { d.put(DCM_PatientID, "other"); });
  EXPECT_THAT(notes_of_loading().warnings,
              ElementsAre(HasSubstr("RTSTRUCT.dcm: PatientID (0010,0020) differs from that of the CT")));
}

}  // namespace
}  // namespace isoshift::rt_structures_test
