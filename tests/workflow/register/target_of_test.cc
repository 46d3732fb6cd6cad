// Which structure is the target: a person's, the site's or the plan's word, in this order, and what holds the
// isocenter.

#include "workflow/register/target_of.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/cube_study.h"
#include "tests/support/small_study.h"

namespace isoshift::target_of_test {
namespace {

using Eigen::Vector3d;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr double kSliceMm = 4.0;

// A box of 5 to 7 slices around a center.
Structure box(int number, const std::string& name, const std::string& type, const Vector3d& center_mm, double edge_mm) {
  Structure structure{.number = number, .name = name, .interpreted_type = type};
  const double lowest = std::round((center_mm.z() - 0.5 * edge_mm) / kSliceMm) * kSliceMm;
  for (double z = lowest; z <= center_mm.z() + 0.5 * edge_mm; z += kSliceMm)
    structure.contours.push_back({.points_patient_mm = rectangle({center_mm.x(), center_mm.y(), z}, edge_mm, edge_mm)});
  return structure;
}

// A CT of 160 mm about the patient's origin; the isocenter at (10, 0, 0).
Study study_with(std::vector<Structure> structures) {
  Study study = cube_study(41, kSliceMm, {10, 0, 0}, [](const Vector3d&) { return 0.0F; });
  study.plan = RtPlan{};
  study.structures = RtStructures{.structures = std::move(structures)};
  return study;
}

TEST(TargetOf, APersonsWordComesFirst) {
  Study study = study_with({box(1, "PTV", "PTV", {10, 0, 0}, 40), box(2, "Node", "", {30, 20, 0}, 24)});
  study.plan->dose_references = {{.number = 1, .type = "TARGET", .roi_number = 1}};
  const TargetChoice choice = target_of(study, {.by_person = "Node", .by_site = "PTV"});
  EXPECT_EQ(choice.target.name, "Node");
  EXPECT_EQ(choice.target.chosen_by, "--target");
  EXPECT_THAT(choice.doubts, IsEmpty());
  // HFS: the room's x is the patient's, its y the patient's z, its z against the patient's y.
  EXPECT_LT((choice.target.center_room_mm - Vector3d(20, 0, -20)).norm(), 2.5);
  EXPECT_EQ(target_of(study, {.by_person = "", .by_site = "Node"}).target.name, "Node");
  EXPECT_EQ(target_of(study, {.by_person = "", .by_site = "Node"}).target.chosen_by, "the site file");
}

TEST(TargetOf, TheIsocenterCanBeAskedFor) {
  const Study study = study_with({box(1, "PTV", "PTV", {10, 0, 0}, 40)});
  const TargetChoice choice = target_of(study, {.by_person = "isocenter", .by_site = ""});
  EXPECT_THAT(choice.target.name, HasSubstr("isocenter's surroundings"));
  EXPECT_EQ(choice.target.center_room_mm, Vector3d(0, 0, 0));
  for (const Vector3d& point : choice.target.extent_room_mm) EXPECT_NEAR(point.norm(), 30.0, 1e-9);
}

TEST(TargetOf, ThePlansDoseReferenceComesBeforeTypes) {
  Study study = study_with({box(1, "PTV_all", "PTV", {10, 0, 0}, 60), box(7, "Boost", "", {10, 0, 0}, 24),
                            box(9, "Cord", "ORGAN", {10, 0, 0}, 80)});
  study.plan->dose_references = {{.number = 1, .type = "TARGET", .roi_number = 7},
                                 {.number = 2, .type = "ORGAN_AT_RISK", .roi_number = 9},
                                 {.number = 3, .type = "TARGET", .roi_number = {}},
                                 {.number = 4, .type = "TARGET", .roi_number = 7}};
  const TargetChoice choice = target_of(study, {});
  EXPECT_EQ(choice.target.name, "Boost");
  EXPECT_EQ(choice.target.chosen_by, "dose reference of the plan");
  EXPECT_THAT(choice.doubts, IsEmpty());
}

TEST(TargetOf, OfTypesThePtvThatHoldsTheIsocenterCounts) {
  const TargetChoice choice =
      target_of(study_with({box(1, "far PTV", "PTV", {-50, 0, 0}, 30), box(2, "CTV", "CTV", {10, 0, 0}, 30),
                            box(3, "GTV", "GTV", {10, 0, 0}, 20)}),
                {});
  EXPECT_EQ(choice.target.name, "CTV");
  EXPECT_EQ(choice.target.chosen_by, "the CTV that holds the isocenter");
  EXPECT_THAT(choice.doubts, IsEmpty());
  double farthest = 0.0;
  for (const Vector3d& point : choice.target.extent_room_mm) farthest = std::max(farthest, point.norm());
  EXPECT_NEAR(farthest, std::sqrt(3.0) * 15.0, 5.0);  // a corner, to a voxel
}

TEST(TargetOf, SeveralThatFitAreADoubt) {
  const TargetChoice choice =
      target_of(study_with({box(1, "PTV 50", "PTV", {10, 0, 0}, 60), box(2, "PTV 66", "PTV", {10, 0, 0}, 30)}), {});
  EXPECT_EQ(choice.target.name, "PTV 66");
  ASSERT_EQ(choice.doubts.size(), 1U);
  EXPECT_THAT(choice.doubts[0], HasSubstr("several structures may be the target (PTV 50, PTV 66); PTV 66 was taken"));
  EXPECT_THAT(choice.doubts[0], HasSubstr("--target NAME"));
}

TEST(TargetOf, WithoutAVolumeAtTheIsocenterItIsTheSurroundings) {
  Study study = study_with({box(1, "far PTV", "PTV", {-50, 0, 0}, 30), box(2, "Body", "EXTERNAL", {0, 0, 0}, 140)});
  study.structures->structures.push_back({.number = 3, .name = "empty PTV", .interpreted_type = "PTV"});
  EXPECT_EQ(target_of(study, {}).target.chosen_by, "no target volume holds the isocenter");
  study.structures = RtStructures{.structures = {box(2, "Body", "EXTERNAL", {0, 0, 0}, 140)}};
  EXPECT_THAT(target_of(study, {}).doubts, IsEmpty());
  study.structures.reset();
  study.plan.reset();
  EXPECT_EQ(target_of(study, {}).target.chosen_by, "the study holds no RT Structure Set");
  EXPECT_THAT(target_of(study, {}).doubts, IsEmpty());
}

// The contours may be another CT's, or the plan another target's.
TEST(TargetOf, TargetVolumesOfWhichNoneHoldsTheIsocenterAreADoubt) {
  for (const auto& [ptv, gtv] : {std::pair("PTV", "GTV"), std::pair("", "")}) {
    const Study study = study_with({box(1, "PTV_50", ptv, {-50, 0, 0}, 30), box(2, "GTV_L", gtv, {10, 40, 0}, 30)});
    EXPECT_THAT(target_of(study, {}).doubts,
                ElementsAre("no target volume holds the isocenter: GTV_L, the nearest one, begins 28 mm from it, and "
                            "the setup was judged at the isocenter. Name the target: --target NAME, or --target "
                            "isocenter"));
    EXPECT_THAT(target_of(study, {.by_person = "isocenter"}).doubts, IsEmpty());
    EXPECT_THAT(target_of(study, {.by_person = "GTV_L"}).doubts, IsEmpty());
  }
}

// Programs that know no types write none, or ORGAN for all: TG-263 begins the names of target volumes with what they
// are.
TEST(TargetOf, NamesTellTargetVolumesWhereNoTypeDoes) {
  for (const char* type : {"", "ORGAN"}) {
    Study study = study_with({box(1, "Cord", type, {10, 0, 0}, 20), box(2, "ptv_70", type, {10, 0, 0}, 40)});
    EXPECT_EQ(target_of(study, {}).target.name, "ptv_70");
    EXPECT_EQ(target_of(study, {}).target.chosen_by,
              "the PTV that holds the isocenter, by its name: its type is not told");
  }
  // Rings and structures for optimization have such names, too, beside target volumes that have their type.
  Study typed = study_with({box(1, "PTV_ring", "ORGAN", {10, 0, 0}, 60), box(2, "Boost", "PTV", {10, 0, 0}, 40)});
  EXPECT_EQ(target_of(typed, {}).target.chosen_by, "the PTV that holds the isocenter");
  EXPECT_THAT(target_of(typed, {}).doubts, IsEmpty());
}

TEST(TargetOf, ATargetVolumeOfOpenContoursIsADoubt) {
  Study study = study_with({});
  study.structures->structures.push_back(
      {.number = 3, .name = "open PTV", .interpreted_type = "PTV", .ignored_contours = 12});
  const TargetChoice choice = target_of(study, {});
  EXPECT_EQ(choice.target.chosen_by, "no target volume holds the isocenter");
  EXPECT_THAT(choice.doubts, ElementsAre(HasSubstr("the target volume open PTV is drawn, but none of its contours is "
                                                   "closed (ContourGeometricType (3006,0042) CLOSED_PLANAR)")));
  study.structures->structures.push_back(box(4, "GTV", "GTV", {10, 0, 0}, 20));
  EXPECT_THAT(target_of(study, {}).doubts, IsEmpty()) << "the target is another";
}

// load_study() refuses structures of another frame of reference, unless a person allows them.
TEST(TargetOf, AnAllowedFrameOfReferenceHoldsForTheDefaultToo) {
  Structure elsewhere = box(4, "PTV", "PTV", {10, 0, 0}, 30);
  elsewhere.frame_of_reference_uid = "9.9";
  Study study = study_with({elsewhere});
  EXPECT_EQ(target_of(study, {}).target.name, "PTV");
  study.plan->dose_references = {{.number = 1, .type = "TARGET", .roi_number = 4}};
  EXPECT_EQ(target_of(study, {}).target.chosen_by, "dose reference of the plan");
  EXPECT_EQ(structures_beside("", study).size(), 1U);
}

TEST(TargetOf, RivalStructureSetsAreADoubtUnlessThePersonNamesTheTarget) {
  Study study = study_with({});
  study.structures.reset();
  study.unused_structures.rivals = {"in/a.dcm", "in/b.dcm"};
  const std::string why = "nothing tells which of 2 RT Structure Sets is meant for this CT (a.dcm, b.dcm)";
  const TargetChoice choice = target_of(study, {});
  EXPECT_EQ(choice.target.chosen_by, why);
  EXPECT_THAT(choice.doubts,
              ElementsAre(why + ": the target may be drawn in one of them. Name it: --structures FILE, or "
                                "--target isocenter"));
  EXPECT_THAT(target_of(study, {.by_person = "isocenter"}).doubts, IsEmpty());
  study.unused_structures = {.rivals = {}, .unusable = {"in/a.dcm"}};
  EXPECT_EQ(target_of(study, {}).target.chosen_by,
            "no RT Structure Set of the study has a closed contour on this CT (a.dcm)");
}

// ROI numbers of the plan mean something else in another structure set.
TEST(TargetOf, DoseReferencesAreOfThePlansOwnStructureSet) {
  Study study = study_with({box(1, "PTV", "PTV", {10, 0, 0}, 40), box(2, "Cord", "ORGAN", {10, 0, 0}, 24)});
  study.structures->path = "in/other.dcm";
  study.structures->sop_instance_uid = "1.1";
  study.plan->dose_references = {{.number = 1, .type = "TARGET", .roi_number = 2}};
  study.plan->structure_set_uid = "1.2";
  const TargetChoice choice = target_of(study, {});
  EXPECT_EQ(choice.target.name, "PTV");
  EXPECT_THAT(choice.doubts,
              ElementsAre(HasSubstr("the plan's target is ROI number 2 (ReferencedROINumber (3006,0084)), of "
                                    "another RT Structure Set than other.dcm")));
  study.plan->structure_set_uid = "1.1";
  EXPECT_EQ(target_of(study, {}).target.name, "Cord");
}

// One of them 60 mm away.
TEST(TargetOf, SeveralDoseReferencesAreADoubt) {
  Study study = study_with({box(1, "PTV", "PTV", {10, 0, 0}, 40), box(2, "L4", "CTV", {10, 0, 60}, 24)});
  study.plan->dose_references = {{.number = 1, .type = "TARGET", .roi_number = 1},
                                 {.number = 2, .type = "TARGET", .roi_number = 2}};
  const TargetChoice choice = target_of(study, {});
  EXPECT_EQ(choice.target.name, "PTV");
  ASSERT_EQ(choice.doubts.size(), 1U);
  EXPECT_THAT(choice.doubts[0], HasSubstr("several structures may be the target (PTV, L4); PTV was taken"));
}

TEST(TargetOf, ADoseReferenceThatCannotBeFollowedIsADoubt) {
  Study study = study_with({box(1, "PTV", "PTV", {10, 0, 0}, 40)});
  study.structures->path = "in/RTSTRUCT.dcm";
  study.structures->structures.push_back({.number = 2, .name = "Boost", .interpreted_type = "PTV"});
  const auto only_doubt = [&](int roi) {
    study.plan->dose_references = {{.number = 1, .type = "TARGET", .roi_number = roi}};
    const TargetChoice choice = target_of(study, {});
    EXPECT_EQ(choice.target.name, "PTV");
    return choice.doubts.size() == 1 ? choice.doubts[0] : "";
  };
  EXPECT_EQ(only_doubt(7),
            "the plan's target is ROI number 7 (ReferencedROINumber (3006,0084)), which RTSTRUCT.dcm does not have. "
            "Name the target: --target NAME or isocenter");
  EXPECT_THAT(only_doubt(2), HasSubstr("\"Boost\", which has no closed contour on this CT in RTSTRUCT.dcm"));
  study.structures.reset();
  EXPECT_THAT(target_of(study, {}).doubts, IsEmpty());
  EXPECT_EQ(target_of(study, {}).target.chosen_by, "the study holds no RT Structure Set");
}

TEST(TargetOf, ATargetThatReachesBeyondTheCtIsADoubt) {
  // The last slice lies at z = 80.
  const Study inside = study_with({box(1, "PTV", "PTV", {10, 0, 50}, 32)}),
              beyond = study_with({box(1, "PTV", "PTV", {10, 0, 76}, 32)}),
              beside = study_with({box(1, "PTV", "PTV", {70, 0, 0}, 40)});
  EXPECT_THAT(target_of(inside, {.by_person = "PTV"}).doubts, IsEmpty());
  for (const Study* study : {&beyond, &beside}) {
    const TargetChoice choice = target_of(*study, {.by_person = "PTV"});
    EXPECT_THAT(choice.doubts, Contains(HasSubstr("the target PTV reaches beyond the CT")));
  }
}

// X-rays show what lies beyond the last slice, and the CT does not.
TEST(TargetOf, TheEndOfTheCtNearTheTargetIsADoubtWhereTheBodyGoesOn) {
  Study study = study_with({box(1, "PTV", "PTV", {10, 0, 60}, 24)});
  EXPECT_THAT(target_of(study, {.by_person = "PTV"}).doubts,
              ElementsAre(HasSubstr("the CT ends 20 mm from the target's center although the body goes on")));
  CtSeries ct = *study.ct;
  for (int j = 0; j < ct.hu.size.y(); ++j)
    for (int i = 0; i < ct.hu.size.x(); ++i) ct.hu.at(i, j, ct.hu.size.z() - 1) = -1000.0F;
  study.ct = std::make_shared<const CtSeries>(std::move(ct));
  EXPECT_THAT(target_of(study, {.by_person = "PTV"}).doubts, IsEmpty()) << "the top of a head";
}

TEST(TargetOf, ANameThatIsNotThereIsAnError) {
  Study study = study_with({box(1, "PTV", "PTV", {10, 0, 0}, 40)});
  EXPECT_THROW(target_of(study, {.by_person = "GTV", .by_site = ""}), Error);
  study.structures.reset();
  try {
    target_of(study, {.by_person = "", .by_site = "PTV"});
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("target PTV (the site file): the study holds no RT Structure Set"));
  }
}

}  // namespace
}  // namespace isoshift::target_of_test
