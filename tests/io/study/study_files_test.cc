#include "io/study/study_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "io/study/session_files.h"
#include "tests/support/small_study.h"

namespace isoshift::study_files_test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::UnorderedElementsAre;

// A folder into which an exporter has put more than one study.
class StudyFilesTest : public testing::Test {
 protected:
  // The files of another phantom, copied beside the first one's.
  void add(const std::filesystem::path& name, std::uint64_t seed) {
    PhantomOptions options = small_phantom();
    options.seed = seed;
    const SmallStudy other(options);
    std::filesystem::copy(other.path(), study_.path() / name, std::filesystem::copy_options::recursive);
  }

  StudyParts find(StudyParts named = {}) {
    named.study = study_.path();
    notes_ = {};
    return find_parts(named, false, notes_);
  }

  std::string error_of_finding(StudyParts named = {}) {
    try {
      find(std::move(named));
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  SmallStudy study_;
  Notes notes_;  // of the last find()
};

TEST_F(StudyFilesTest, FindsThePartsOfOneStudy) {
  const StudyParts parts = find();
  EXPECT_EQ(parts.ct.size(), 36U);
  EXPECT_EQ(parts.plan, study_.plan());
  EXPECT_THAT(parts.images, ElementsAre(study_.image(0), study_.image(1)));
  EXPECT_THAT(notes_.left_aside, ElementsAre(HasSubstr("truth.json: not a DICOM file")));
}

TEST_F(StudyFilesTest, TakesTheCtInThePlansFrameOfReferenceAndSaysWhatItLeft) {
  add("other", 2);
  std::filesystem::remove(study_.path() / "other" / "RTPLAN.dcm");
  std::filesystem::remove_all(study_.path() / "other" / "RTIMAGE");
  const StudyParts parts = find();
  EXPECT_EQ(parts.ct.front(), study_.ct_slice(0));
  EXPECT_THAT(notes_.left_aside, Contains(HasSubstr("CT0000.dcm and 35 more: CT series")));
}

TEST_F(StudyFilesTest, TakesThePlanThatTheXraysReferTo) {
  add("other", 2);
  std::filesystem::remove_all(study_.path() / "other" / "RTIMAGE");
  const StudyParts parts = find();
  EXPECT_EQ(parts.plan, study_.plan());
  EXPECT_THAT(notes_.left_aside, Contains(HasSubstr("other/RTPLAN.dcm: an RT Plan that no X-ray refers to")));
}

TEST_F(StudyFilesTest, ACopyOfThePlanIsThePlan) {
  fs::copy_file(study_.plan(), study_.path() / "copy.dcm");
  find();
  EXPECT_THAT(notes_.left_aside, Contains(HasSubstr("the same RT Plan as")));
  edit(study_.path() / "copy.dcm", [](DicomItem d) { d.put(DCM_RTPlanLabel, "OTHER"); });
  EXPECT_THAT(error_of_finding(), HasSubstr("but other contents.\n       Name the plan: --plan FILE"));
}

TEST_F(StudyFilesTest, AnXrayOfAPlanThatIsNotHereIsLeftAside) {
  const fs::path stray = study_.path() / "stray.dcm";
  fs::copy_file(study_.image(0), stray);
  edit(stray, [](DicomItem d) {
    d.put(DCM_SOPInstanceUID, "1.2.3.4");
    d.items(DCM_ReferencedRTPlanSequence)[0].put(DCM_ReferencedSOPInstanceUID, "1.2.3");
  });
  EXPECT_THAT(find().images, ElementsAre(study_.image(0), study_.image(1)));
  EXPECT_THAT(notes_.left_aside, Contains(HasSubstr("stray.dcm: an X-ray of a plan that is not here (1.2.3)")));
  StudyParts named;
  named.images = {study_.image(0), study_.image(1), stray};
  EXPECT_EQ(find(named).images.size(), 3U) << "what a person names is a matter for checks";
}

// As planning systems export them with the plan.
TEST_F(StudyFilesTest, PlanningDrrsAndFluencesAreLeftAsideWhereThereAreXrays) {
  const std::vector<std::string> types = {"DRR", "FLUENCE"};
  std::vector<fs::path> computed;
  for (const std::string& type : types) {
    computed.push_back(study_.path() / ("RtImage_" + type + ".dcm"));
    fs::copy_file(study_.image(0), computed.back());
    edit(computed.back(), [&](DicomItem d) {
      d.put(DCM_SOPInstanceUID, "1.2.3." + std::to_string(computed.size()));
      d.put(DCM_ImageType, "DERIVED\\SECONDARY\\" + type);
      d.put(DCM_ReportedValuesOrigin, "PLAN");
    });
  }
  EXPECT_THAT(find().images, ElementsAre(study_.image(0), study_.image(1)));
  for (const fs::path& file : computed)
    EXPECT_THAT(notes_.left_aside, Contains(AllOf(HasSubstr(file.string()), HasSubstr("says that it was computed"))));
  // A DRR that is called a radiograph.
  edit(computed[0], [](DicomItem d) { d.put(DCM_ImageType, "DERIVED\\SECONDARY\\RADIOGRAPH"); });
  EXPECT_THAT(find().images, ElementsAre(study_.image(0), study_.image(1)));
  const StudyParts one_is_named = {.images = {study_.image(1), computed[0]}};
  EXPECT_THAT(find(one_is_named).images, ElementsAre(study_.image(1), computed[0])) << "that is a matter for checks";
  std::vector<SessionFiles> sessions = sessions_of(scan_study({study_.path()}), false);
  ASSERT_EQ(sessions.size(), 1U);
  EXPECT_EQ(sessions[0].images.size(), 2U);
  fs::remove_all(study_.image(0).parent_path());
  EXPECT_EQ(find().images.size(), 2U) << "nothing else is there: checks say what they are";
  EXPECT_FALSE(sessions_of(scan_study({study_.path()}), false).empty());
}

// However a planning system writes it (PS3.3 C.8.8.2).
TEST_F(StudyFilesTest, PlanningDrrsAreKnownByAnyWayOfSayingIt) {
  const fs::path drr = study_.path() / "drr.dcm";
  fs::copy_file(study_.image(0), drr);
  for (const char* type : {R"(DERIVED\SECONDARY\drr)", R"(DERIVED\SECONDARY\PORTAL\DRR)", R"(DERIVED\SECONDARY\\Drr)",
                           R"(DERIVED\SECONDARY)", R"(DERIVED\SECONDARY\)"}) {
    edit(drr, [&](DicomItem d) {
      d.put(DCM_SOPInstanceUID, "1.2.3.9");
      d.put(DCM_AcquisitionDate, "20270101");
      d.put(DCM_ImageType, type);
    });
    EXPECT_THAT(find().images, ElementsAre(study_.image(0), study_.image(1))) << type;
    EXPECT_THAT(notes_.left_aside, Contains(AllOf(HasSubstr(drr.string()), HasSubstr("says that it was computed"))));
  }
  edit(drr, [](DicomItem d) { d.put(DCM_ImageType, R"(DERIVED\SECONDARY\PORTAL\ENHANCED)"); });
  EXPECT_EQ(find().images.size(), 3U) << "an X-ray that was processed";
}

TEST_F(StudyFilesTest, XraysOfFormatsThatAreNotReadAreNamed) {
  const std::string his("\x00\x70\x44\x00 and more", 13);
  for (const auto& [name, content, words] :
       {std::tuple("ap.xim", std::string("VMS.XI\0\0\1", 9), "Varian linac (XIM)"),
        std::tuple("lat.bin", his, "Elekta imager (HIS)"), std::tuple("1.raw", std::string(64, 'x'), "ExacTrac")}) {
    std::ofstream(study_.path() / name, std::ios::binary) << content;
    find();
    EXPECT_THAT(notes_.left_aside, Contains(AllOf(HasSubstr(name), HasSubstr(words), HasSubstr("export it as"))));
  }
  EXPECT_THAT(error_of_finding({.images = {study_.path() / "ap.xim"}}),
              HasSubstr("ap.xim: an image of a Varian linac"));
  fs::remove_all(study_.image(0).parent_path());
  EXPECT_THAT(error_of_finding(), AllOf(HasSubstr("no RT Image found"), HasSubstr("1.raw: pixels without a header")));
}

TEST_F(StudyFilesTest, TwoWholeStudiesNeedAName) {
  add("other", 2);
  EXPECT_THAT(error_of_finding(), HasSubstr("2 RT Plans found, and the X-rays do not tell which one is meant"));
  EXPECT_THAT(error_of_finding(), HasSubstr("Name the plan: --plan FILE"));
}

TEST_F(StudyFilesTest, ANamedPlanLeavesTheOtherStudyAside) {
  add("other", 2);
  const StudyParts parts = find({.study = {}, .ct = {}, .images = {}, .plan = study_.path() / "other" / "RTPLAN.dcm"});
  EXPECT_EQ(parts.ct.front(), study_.path() / "other" / "CT" / "CT0000.dcm");
  EXPECT_EQ(parts.images.size(), 2U);
  EXPECT_THAT(parts.images.front().string(), HasSubstr("/other/"));
  EXPECT_THAT(notes_.left_aside, Contains(study_.image(0).string() + ": an X-ray of another plan"));
  EXPECT_THAT(notes_.left_aside, Contains(study_.plan().string() + ": an RT Plan that was not named"));
}

TEST_F(StudyFilesTest, OfSeveralCtsInOneFrameTheStructureSetDecides) {
  std::string frame_of_reference;
  edit(study_.plan(), [&](DicomItem d) {
    frame_of_reference = d.required_text(DCM_FrameOfReferenceUID);
    DicomItem reference = d.append_item(DCM_ReferencedStructureSetSequence);
    reference.put(DCM_ReferencedSOPClassUID, "1.2.840.10008.5.1.4.1.1.481.3");
    reference.put(DCM_ReferencedSOPInstanceUID, "1.2.3.4");
  });
  add("other", 2);
  std::filesystem::remove(study_.path() / "other" / "RTPLAN.dcm");
  std::filesystem::remove_all(study_.path() / "other" / "RTIMAGE");
  std::string other_series;
  for (const auto& entry : std::filesystem::directory_iterator(study_.path() / "other" / "CT"))
    edit(entry.path(), [&](DicomItem d) {
      d.put(DCM_FrameOfReferenceUID, frame_of_reference);
      other_series = d.required_text(DCM_SeriesInstanceUID);
    });
  EXPECT_THAT(error_of_finding(), HasSubstr("2 CT series found, and the plan does not tell which one it was made on"));

  DicomFile structures;
  DicomItem d = structures.dataset();
  d.put(DCM_SOPClassUID, "1.2.840.10008.5.1.4.1.1.481.3");
  d.put(DCM_SOPInstanceUID, "1.2.3.4");
  d.append_item(DCM_ReferencedFrameOfReferenceSequence)
      .append_item(DCM_RTReferencedStudySequence)
      .append_item(DCM_RTReferencedSeriesSequence)
      .put(DCM_SeriesInstanceUID, other_series);
  structures.write(study_.path() / "RTSTRUCT.dcm");
  EXPECT_THAT(find().ct.front().string(), HasSubstr("/other/CT/"));
}

TEST_F(StudyFilesTest, TakesTheOnlyStructureSetDrawnOnTheCt) {
  EXPECT_EQ(find().structures, std::filesystem::path());
  draw(study_, {{"Spine", {}}});
  EXPECT_EQ(find().structures, study_.structures());
  // Drawn on other images, although in the same frame of reference.
  edit(study_.structures(), [](DicomItem d) {
    d.append_item(DCM_ReferencedFrameOfReferenceSequence)
        .append_item(DCM_RTReferencedStudySequence)
        .append_item(DCM_RTReferencedSeriesSequence)
        .put(DCM_SeriesInstanceUID, "1.2.3");
  });
  const StudyParts parts = find();
  EXPECT_EQ(parts.structures, std::filesystem::path());
  EXPECT_THAT(notes_.left_aside,
              Contains(study_.structures().string() + ": an RT Structure Set that was not drawn on the CT"));
}

TEST_F(StudyFilesTest, AStructureSetOfThePlanThatIsAbsentOrDrawnOnAnotherCtIsToldOf) {
  draw(study_, {{"Spine", {}}});
  edit(study_.plan(), [](DicomItem d) {
    d.append_item(DCM_ReferencedStructureSetSequence).put(DCM_ReferencedSOPInstanceUID, "1.2.3.5");
  });
  StudyParts parts = find();
  EXPECT_EQ(parts.structures, study_.structures());
  EXPECT_TRUE(parts.doubts.empty());
  EXPECT_THAT(notes_.warnings, Contains(study_.plan().string() +
                                        ": the RT Structure Set to which the plan refers is not there (1.2.3.5)"));
  edit(study_.structures(), [](DicomItem d) {
    d.put(DCM_SOPInstanceUID, "1.2.3.5");
    d.append_item(DCM_ReferencedFrameOfReferenceSequence)
        .append_item(DCM_RTReferencedStudySequence)
        .append_item(DCM_RTReferencedSeriesSequence)
        .put(DCM_SeriesInstanceUID, "1.2.3");
  });
  parts = find();
  ASSERT_EQ(parts.doubts.size(), 1U);
  EXPECT_THAT(parts.doubts.front(), HasSubstr("was not drawn on this CT: the plan may have been made on another one"));
}

TEST_F(StudyFilesTest, OfSeveralStructureSetsThePlanOrAPersonDecides) {
  draw(study_, {{"Spine", {rectangle({0, 40, -400}, 20, 20)}}});
  const std::filesystem::path second = study_.path() / "RTSTRUCT2.dcm", copy = study_.path() / "copy.dcm";
  std::filesystem::copy(study_.structures(), second);
  edit(second, [](DicomItem d) { d.put(DCM_SOPInstanceUID, "1.2.3.5"); });
  StudyParts parts = find();
  EXPECT_EQ(parts.structures, std::filesystem::path());
  EXPECT_THAT(parts.unused_structures.rivals, UnorderedElementsAre(study_.structures(), second));
  for (const std::filesystem::path& file : {study_.structures(), second})
    EXPECT_THAT(notes_.left_aside,
                Contains(file.string() + ": one of 2 RT Structure Sets drawn on the CT; name the one "
                                         "meant: --structures FILE"));

  StudyParts named;
  named.structures = study_.structures();
  parts = find(named);
  EXPECT_EQ(parts.structures, study_.structures());
  EXPECT_THAT(notes_.left_aside, Contains(second.string() + ": an RT Structure Set that was not named"));

  edit(study_.plan(), [](DicomItem d) {
    d.append_item(DCM_ReferencedStructureSetSequence).put(DCM_ReferencedSOPInstanceUID, "1.2.3.5");
  });
  std::filesystem::copy(second, copy);
  parts = find();
  EXPECT_EQ(parts.structures, second);
  EXPECT_THAT(notes_.left_aside,
              Contains(study_.structures().string() + ": an RT Structure Set that the plan does not refer to"));
  EXPECT_THAT(notes_.left_aside, Contains(copy.string() + ": the same RT Structure Set as " + second.string()));
}

// Drawn again under the same UID: the name of a file must not decide.
TEST_F(StudyFilesTest, StructureSetsOfOneUidWithOtherContentsAreRivals) {
  draw(study_, {{"PTV", {rectangle({0, 40, -400}, 20, 20)}}});
  const fs::path again = study_.path() / "RS_again.dcm";
  fs::copy(study_.structures(), again);
  EXPECT_TRUE(find().unused_structures.rivals.empty());
  edit(again, [](DicomItem d) { d.put(DCM_StructureSetLabel, "LATER"); });
  const StudyParts parts = find();
  EXPECT_EQ(parts.structures, fs::path());
  EXPECT_THAT(parts.unused_structures.rivals, UnorderedElementsAre(study_.structures(), again));
}

// Where UIDs were replaced in some files only, references lead nowhere.
TEST_F(StudyFilesTest, AStructureSetOfACtThatIsNotHereMayHoldTheTarget) {
  draw(study_, {{"PTV", {rectangle({0, 40, -400}, 20, 20)}}});
  edit(study_.structures(), [](DicomItem d) {
    d.append_item(DCM_ReferencedFrameOfReferenceSequence)
        .append_item(DCM_RTReferencedStudySequence)
        .append_item(DCM_RTReferencedSeriesSequence)
        .put(DCM_SeriesInstanceUID, "1.2.3");
  });
  const StudyParts parts = find();
  EXPECT_EQ(parts.structures, fs::path());
  EXPECT_THAT(parts.unused_structures.rivals, ElementsAre(study_.structures()));
  EXPECT_EQ(why_no_structures(parts.unused_structures),
            "nothing tells whether RTSTRUCT.dcm was drawn on this CT: it names another one, which is not here");
  EXPECT_THAT(notes_.left_aside,
              Contains(study_.structures().string() + ": an RT Structure Set of another CT, which is not here"));
}

// As treatment planning systems export them: a set that holds a setup isocenter, drawn on the same CT.
TEST_F(StudyFilesTest, AStructureSetOfPointsDoesNotCompete) {
  draw(study_, {{"InitLaserIso", {{{1, 2, 3}}}, "POINT"}, {"AcqIsocenter", {{{1, 2, 3}}}, "CLOSED_PLANAR"}});
  const std::filesystem::path points = study_.path() / "RS_setup.dcm";
  std::filesystem::rename(study_.structures(), points);
  edit(points, [](DicomItem d) { d.put(DCM_SOPInstanceUID, "1.2.3.6"); });
  EXPECT_EQ(find().structures, points) << "the only one there is";
  draw(study_, {{"PTV", {rectangle({0, 40, -400}, 20, 20)}}});
  EXPECT_EQ(find().structures, study_.structures());
  EXPECT_THAT(notes_.left_aside, Contains(points.string() + ": an RT Structure Set without closed contours"));
  for (const char* of_plan : {"1.2.3.9", "1.2.3.6"}) {  // not there, and that of the points
    edit(study_.plan(), [&](DicomItem d) {
      d.erase(DCM_ReferencedStructureSetSequence);
      d.append_item(DCM_ReferencedStructureSetSequence).put(DCM_ReferencedSOPInstanceUID, of_plan);
    });
    EXPECT_EQ(find().structures, study_.structures()) << of_plan;
  }
  EXPECT_THAT(notes_.warnings, Contains(HasSubstr("to which the plan refers has no closed contour (1.2.3.6)")));
}

TEST_F(StudyFilesTest, WhyThereAreNoStructuresIsTold) {
  const auto why = [&] { return why_no_structures(find().unused_structures); };
  EXPECT_EQ(why(), "the study holds no RT Structure Set");
  draw(study_, {{"PTV", {rectangle({0, 40, -400}, 20, 20)}}});
  const std::filesystem::path second = study_.path() / "second.dcm";
  std::filesystem::copy(study_.structures(), second);
  edit(second, [](DicomItem d) { d.put(DCM_SOPInstanceUID, "1.2.3.5"); });
  EXPECT_EQ(why(), "nothing tells which of 2 RT Structure Sets is meant for this CT (RTSTRUCT.dcm, second.dcm)");
  for (const std::filesystem::path& file : {study_.structures(), second}) std::filesystem::remove(file);
  draw(study_, {{"Isocenter", {{{1, 2, 3}}}, "POINT"}});
  edit(study_.structures(), [](DicomItem d) {
    d.append_item(DCM_ReferencedFrameOfReferenceSequence)
        .append_item(DCM_RTReferencedStudySequence)
        .append_item(DCM_RTReferencedSeriesSequence)
        .put(DCM_SeriesInstanceUID, "1.2.3");
  });
  EXPECT_EQ(why(), "no RT Structure Set of the study has a closed contour on this CT (RTSTRUCT.dcm)");
}

TEST_F(StudyFilesTest, ACtInNoPlansFrameIsRefused) {
  add("other", 2);
  std::filesystem::remove(study_.path() / "other" / "RTPLAN.dcm");
  std::filesystem::remove_all(study_.path() / "other" / "RTIMAGE");
  edit(study_.plan(), [](DicomItem d) { d.put(DCM_FrameOfReferenceUID, "1.2.3"); });
  EXPECT_THAT(error_of_finding(), HasSubstr("2 CT series found, and none is in the plan's frame of reference"));
}

TEST_F(StudyFilesTest, LocalizersAndOtherObjectsAreLeftAside) {
  edit(study_.ct_slice(0), [](DicomItem d) { d.put(DCM_ImageType, "ORIGINAL\\PRIMARY\\LOCALIZER"); });
  edit(study_.ct_slice(35), [](DicomItem d) { d.put(DCM_SOPClassUID, "1.2.840.10008.5.1.4.1.1.4"); });
  const StudyParts parts = find();
  EXPECT_EQ(parts.ct.size(), 34U);
  EXPECT_THAT(notes_.left_aside, Contains(HasSubstr("CT0000.dcm: a CT localizer")));
  EXPECT_THAT(notes_.left_aside, Contains(HasSubstr("CT0035.dcm: MRImageStorage")));
}

TEST_F(StudyFilesTest, FilesThatLostTheirContentsAreSaid) {
  const TemporaryFolder folder;
  std::ofstream(folder / "empty.dcm");
  std::ofstream(folder / "zeros") << std::string(200, '\0');
  std::ofstream(folder / "cut.dcm") << std::string(100, 'x');
  for (const char* name : {"export.done", "README", "notes.txt"}) std::ofstream(folder / name) << "text";
  std::ofstream(folder / "transfer.ok");
  const StudyFiles files = scan_study({folder.path()});
  EXPECT_THAT(files.unreadable, UnorderedElementsAre(HasSubstr("empty.dcm: is empty or begins with zeros"),
                                                     HasSubstr("zeros: is empty or begins with zeros"),
                                                     HasSubstr("cut.dcm: is not a DICOM file, as its name says")));
  EXPECT_EQ(files.left_aside.size(), 4U);
}

TEST_F(StudyFilesTest, WhatWasNamedIsWhatTheMessageNames) {
  EXPECT_EQ(error_of_finding({.study = {}, .ct = {}, .images = {study_.truth()}, .plan = {}}),
            "no RT Image found (searched " + study_.truth().string() + ").\n       Name the X-rays: --image FILE");
  EXPECT_EQ(error_of_finding({.study = {}, .ct = {}, .images = {}, .plan = study_.truth()}),
            study_.truth().string() + ": holds no RT Plan");
  StudyParts named;
  named.structures = study_.plan();
  EXPECT_EQ(error_of_finding(named), study_.plan().string() +
                                         ": holds no RT Structure Sets, expected one.\n       Name the file: "
                                         "--structures FILE");
}

}  // namespace
}  // namespace isoshift::study_files_test
