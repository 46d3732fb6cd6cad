#include "io/study/session_files.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "base/output_folder.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::session_files_test {
namespace {

StudyFiles::Image image(const std::string& uid, const std::string& label, std::optional<double> at_s,
                        const std::string& patient = "P", const std::string& plan = "1") {
  return {
      .file = "/x/" + uid, .patient = patient, .sop_instance_uid = uid, .plan_uid = plan, .label = label, .at_s = at_s};
}

std::vector<std::size_t> sizes(const std::vector<StudyFiles::Image>& images) {
  StudyFiles files;
  files.images = images;
  std::vector<std::size_t> sizes;
  for (const SessionFiles& session : sessions_of(files, false)) sizes.push_back(session.images.size());
  return sizes;
}

TEST(Sessions, ArePatientsPlansAndMoments) {
  using testing::ElementsAre;
  EXPECT_THAT(sizes({image("1", "A", 0), image("2", "B", 599)}), ElementsAre(2));
  EXPECT_THAT(sizes({image("2", "B", 601), image("1", "A", 0)}), ElementsAre(1, 1));
  EXPECT_THAT(sizes({image("1", "A", 0), image("2", "B", 1, "Q")}), ElementsAre(1, 1));
  EXPECT_THAT(sizes({image("1", "A", 0), image("2", "B", 1, "P", "2")}), ElementsAre(1, 1));
  // Taken again after a move: a label that comes again begins another session.
  EXPECT_THAT(sizes({image("1", "A", 0), image("2", "B", 5), image("3", "A", 60), image("4", "B", 65)}),
              ElementsAre(2, 2));
  EXPECT_THAT(sizes({image("1", "A", 0), image("1", "A", 0)}), ElementsAre(1));  // twice the same
  EXPECT_THAT(sizes({image("1", "A", std::nullopt), image("2", "B", std::nullopt)}), ElementsAre(2));
}

// The UIDs of each session's X-rays, joined.
std::vector<std::string> grouped(const std::vector<StudyFiles::Image>& images,
                                 const std::set<std::string>& registered = {}) {
  StudyFiles files;
  files.images = images;
  std::vector<std::string> sessions;
  for (const SessionFiles& session : sessions_of(files, false, registered)) {
    std::string& uids = sessions.emplace_back();
    for (const StudyFiles::Image& image : session.images) uids += image.sop_instance_uid;
  }
  return sessions;
}

StudyFiles::Image at_table(StudyFiles::Image image, double vertical_mm) {
  image.table = {.lateral_mm = 0.0, .longitudinal_mm = 0.0, .vertical_mm = vertical_mm, .are_measured = true};
  return image;
}

TEST(Sessions, ARetakeIsNotPairedAcrossACouchMove) {
  using testing::ElementsAre;
  // AP and LAT at 10:15, LAT again at 10:16, the couch moves, AP at 10:20, LAT at 10:20:10.
  const std::vector<StudyFiles::Image> day = {image("a", "AP", 0), image("b", "LAT", 10), image("c", "LAT", 60),
                                              image("d", "AP", 300), image("e", "LAT", 310)};
  EXPECT_THAT(grouped(day), ElementsAre("ab", "c", "de"));
  EXPECT_THAT(grouped(day, {"a", "b"}), ElementsAre("c", "de"));
  // While the last X-ray is still on its way, and whichever of the first two was taken again.
  EXPECT_THAT(grouped({day[0], day[1], day[2], day[3]}), ElementsAre("ab", "c", "d"));
  EXPECT_THAT(grouped({day[0], day[1], day[2], day[3]}, {"a", "b"}), ElementsAre("c", "d"));
  const StudyFiles::Image again = image("c", "AP", 60), lateral = image("d", "LAT", 300);
  EXPECT_THAT(grouped({day[0], day[1], again, lateral}), ElementsAre("ab", "c", "d"));
  EXPECT_THAT(grouped({day[0], day[1], again, lateral}, {"a", "b"}), ElementsAre("c", "d"));
  // The first of two that verify is nearer to the second one than to what was registered.
  EXPECT_THAT(grouped({day[0], day[1], image("c", "LAT", 120), image("d", "AP", 130)}, {"a", "b"}), ElementsAre("cd"));
  // An X-ray that comes late does not join those that have a result.
  EXPECT_THAT(grouped(day, {"a", "b", "d", "e"}), ElementsAre("c"));
}

TEST(Sessions, ARetakeIsSaid) {
  StudyFiles files;
  files.images = {image("a", "AP", 0), image("b", "LAT", 10), image("c", "LAT", 60), image("d", "AP", 300),
                  image("e", "LAT", 310)};
  const std::vector<SessionFiles> sessions = sessions_of(files, false);
  ASSERT_EQ(sessions.size(), 3u);
  EXPECT_THAT(sessions[0].remarks, testing::IsEmpty());
  EXPECT_THAT(sessions[1].remarks, testing::ElementsAre("LAT was taken again 50 s after /x/b"));
  EXPECT_THAT(sessions[2].remarks,
              testing::ElementsAre("AP was taken again 300 s after /x/a", "LAT was taken again 250 s after /x/c"));
}

TEST(Sessions, AMovedTableSeparatesThem) {
  using testing::ElementsAre;
  const StudyFiles::Image a = image("a", "AP", 0), b = image("b", "LAT", 10);
  EXPECT_THAT(grouped({at_table(a, 5.0), at_table(b, 5.4)}), ElementsAre("ab"));
  EXPECT_THAT(grouped({at_table(a, 5.0), at_table(b, 8.1)}), ElementsAre("a", "b"));
  // The AP that verifies was taken 40 s after the couch moved, its LAT much later: the table says what belongs
  // together.
  EXPECT_THAT(grouped({at_table(a, 5.0), at_table(b, 5.0), at_table(image("c", "AP", 50), 2.0),
                       at_table(image("d", "LAT", 300), 2.0)}),
              ElementsAre("ab", "cd"));
  // One side without read-outs: the times decide.
  EXPECT_THAT(grouped({a, at_table(b, 5.0)}), ElementsAre("ab"));
}

TEST(Sessions, ARetakeBeforeAMoveIsNotPairedWithWhatFollowsSoonAfter) {
  // AP was taken again 40 s after the pair, LAT 30 s later: the couch may have moved before or after that AP.
  EXPECT_THAT(grouped({image("a", "AP", 0), image("b", "LAT", 10), image("c", "AP", 50), image("d", "LAT", 80)}),
              testing::ElementsAre("ab", "c", "d"));
}

// The doubts of the only session of two X-rays.
std::vector<std::string> doubts_of(const std::vector<StudyFiles::Image>& images,
                                   const std::vector<StudyFiles::Image>& other_xrays = {}) {
  StudyFiles files;
  files.images = images;
  files.other_xrays = other_xrays;
  std::vector<std::string> doubts = {"there is no session of two X-rays"};
  for (const SessionFiles& session : sessions_of(files, false))
    if (session.images.size() == 2) doubts = session.doubts;
  return doubts;
}

// Evidence that the couch may have moved between the views, of X-rays that are not in the session.
TEST(Sessions, AnXrayBetweenTheViewsMakesThemDoubtful) {
  using testing::ElementsAre;
  using testing::HasSubstr;
  const StudyFiles::Image ap = image("a", "AP", 0), lat = image("c", "LAT", 60);
  EXPECT_THAT(doubts_of({ap, lat}), testing::IsEmpty());
  StudyFiles::Image of_other_machine = image("b", "AP", 40);
  of_other_machine.machine = "LINAC2";
  EXPECT_THAT(doubts_of({ap, of_other_machine, lat}), ElementsAre(HasSubstr("/x/b was taken between these views")));
  EXPECT_THAT(doubts_of({ap, image("b", "AP", 40, "P", "2"), lat}), ElementsAre(HasSubstr("between these views")));
  EXPECT_THAT(doubts_of({ap, lat}, {image("b", "AP", 40)}), ElementsAre(HasSubstr("between these views")));
  EXPECT_THAT(doubts_of({ap, image("b", "AP", std::nullopt), lat}),
              ElementsAre(HasSubstr("/x/b shows AP, too, and whether it was taken before or after is not known")));
  EXPECT_THAT(doubts_of({ap, image("b", "AP", 40, "Q"), lat}), testing::IsEmpty());
  StudyFiles::Image at_couch = at_table(ap, -150), too = at_table(lat, -150);
  at_couch.table.longitudinal_mm = too.table.longitudinal_mm = 812.0;
  EXPECT_THAT(doubts_of({at_couch, of_other_machine, too}), testing::IsEmpty());  // the table did not move
  at_couch.table.are_measured = too.table.are_measured = false;                   // planned, or typed in
  EXPECT_THAT(doubts_of({at_couch, of_other_machine, too}), ElementsAre(HasSubstr("between these views")));
}

// A copy in another class has the time of what it copies, and no label.
TEST(Sessions, ACopyOfAViewIsNoEvidence) {
  StudyFiles files;
  files.images = {image("a", "AP", 0), image("b", "LAT", 60), image("c", "OBL", 80)};
  files.other_xrays = {image("d", "", 60)};
  EXPECT_THAT(sessions_of(files, false).at(0).doubts, testing::IsEmpty());
  files.other_xrays = {image("d", "", 61)};
  EXPECT_THAT(sessions_of(files, false).at(0).doubts, testing::SizeIs(1));
}

TEST(Sessions, TimesOfTwoKindsAreNotCompared) {
  StudyFiles files;
  files.images = {image("a", "AP", 0), image("b", "LAT", 60)};
  files.other_xrays = {image("c", "AP", -7150)};  // two hours east of Greenwich: between the views
  files.other_xrays[0].has_utc_offset = true;
  EXPECT_THAT(sessions_of(files, false).at(0).doubts,
              testing::ElementsAre(testing::HasSubstr("whether it was taken before or after is not known")));
  files.other_xrays[0].at_s = -24 * 3600.0;
  EXPECT_THAT(sessions_of(files, false).at(0).doubts, testing::IsEmpty());
}

// AP, the couch moves, LAT, and soon after it AP and LAT.
TEST(Sessions, AViewThatLiesNearerToOthersThanToItsOwnIsDoubtful) {
  StudyFiles files;
  files.images = {image("a", "AP", 0), image("b", "LAT", 50), image("c", "AP", 60), image("d", "LAT", 65)};
  const std::vector<SessionFiles> sessions = sessions_of(files, false);
  ASSERT_EQ(sessions.size(), 2U);
  EXPECT_THAT(sessions[0].doubts, testing::ElementsAre(testing::HasSubstr("/x/c, 10 s after, lies nearer to one of")));
  EXPECT_THAT(sessions[1].doubts, testing::IsEmpty());
}

// Two setups whose X-rays all have the time of the export: which AP goes with which LAT is a guess.
TEST(Sessions, EqualTimesTellNoOrder) {
  StudyFiles files;
  files.images = {image("a", "AP", 0), image("b", "LAT", 0), image("c", "AP", 0), image("d", "LAT", 0)};
  const std::vector<SessionFiles> sessions = sessions_of(files, false);
  ASSERT_EQ(sessions.size(), 2U);
  for (const SessionFiles& session : sessions)
    EXPECT_THAT(session.doubts, testing::Contains(testing::HasSubstr("with the time of one of these views")));
}

TEST(Sessions, OneUidOfTwoXraysIsADoubt) {
  const TemporaryFolder folder;
  StudyFiles files;
  files.images = {image("1", "AP", 0), image("1", "AP", 50), image("2", "LAT", 60)};
  for (std::size_t n = 0; n < files.images.size(); ++n) {
    files.images[n].file = folder / fmt::format("image{}", n);
    write_text(files.images[n].file, n == 1 ? "another" : "one");
  }
  compare_copies(files);
  const std::vector<SessionFiles> sessions = sessions_of(files, false);
  ASSERT_EQ(sessions.size(), 1U);
  EXPECT_THAT(sessions[0].doubts,
              testing::Contains(testing::HasSubstr("have one SOPInstanceUID and different contents")));
  replace_text(files.images[1].file, "one");
  for (StudyFiles::Image& one : files.images) one.other.clear();
  compare_copies(files);
  EXPECT_THAT(sessions_of(files, false)[0].doubts, testing::IsEmpty());
}

TEST(Sessions, WhatComesLaterMayObjectToAResult) {
  StudyFiles files;
  files.images = {image("a", "AP", 0), image("b", "LAT", 60)};
  EXPECT_EQ(objection_to({"a", "b"}, files, false, {"a", "b"}), "");
  files.images.push_back(image("c", "LAT", 200));
  EXPECT_THAT(objection_to({"a", "b"}, files, false, {"a", "b"}),
              testing::HasSubstr("/x/c, 140 s after, has no partner"));
  files.images.push_back(image("d", "AP", 190));
  EXPECT_EQ(objection_to({"a", "b"}, files, false, {"a", "b"}), "");
  files.images.push_back(image("e", "AP", 55));
  EXPECT_EQ(objection_to({"a", "b"}, files, false, {"a", "b"}),
            "together with X-rays that have come later, these would be grouped in another way");
}

// One folder per X-ray.
TEST(Sessions, AFileThatCannotBeReadCountsBelowTheFolderOfAllXrays) {
  const StudyParts apart{.ct = {"/a/ct/1"}, .images = {"/a/b/1/ap.dcm", "/a/b/2/lat.dcm"}};
  EXPECT_EQ(unreadable_beside(apart, {"/a/b/3/x.dcm: is cut off"}), "/a/b/3/x.dcm: is cut off");
  EXPECT_EQ(unreadable_beside(apart, {"/a/c/x.dcm: is cut off", "/a/bb/x.dcm: is cut off"}), "");
  EXPECT_EQ(unreadable_beside({.images = {"/a/b/1/ap.dcm", "/a/b/1/lat.dcm", "/a/b/2/obl.dcm"}}, {"/a/b/3/x.dcm: bad"}),
            "");
  const StudyParts together{.ct = {"/a/ct/1"}, .images = {"/a/b/ap.dcm", "/a/b/lat.dcm"}};
  EXPECT_EQ(unreadable_beside(together, {"/a/b/3/x.dcm: is cut off"}), "");
  EXPECT_EQ(unreadable_beside(together, {"/a/b/x.dcm: is cut off"}), "/a/b/x.dcm: is cut off");
}

// AP and LAT, the couch moves, ...; the last LAT was not taken, or the first AP was not exported: what lies near each
// other is not one setup, and every session of such a chain has whole neighbors but for those at its ends.
TEST(Sessions, AChainOfSessionsThatMayBeShiftedIsDoubtful) {
  const auto doubtful = [](const std::vector<double>& seconds, const std::string& first,
                           const std::vector<StudyFiles::Image>& other_xrays = {}) {
    StudyFiles files;
    files.other_xrays = other_xrays;
    std::string label = first;
    for (const double second : seconds) {
      files.images.push_back(image(fmt::format("{}", second), label, second));
      label = label == "AP" ? "LAT" : "AP";
    }
    std::string pairs;  // "!": with a doubt
    for (const SessionFiles& session : sessions_of(files, false))
      if (session.images.size() == 2)
        pairs += fmt::format("{}+{}{} ", session.images[0].sop_instance_uid, session.images[1].sop_instance_uid,
                             session.doubts.empty() ? "" : "!");
    return pairs;
  };
  EXPECT_EQ(doubtful({0, 60, 80, 140, 160}, "AP"), "60+80! 140+160! ");
  EXPECT_EQ(doubtful({0, 20, 80, 100, 160}, "LAT"), "0+20! 80+100! ");
  EXPECT_EQ(doubtful({0, 80, 95}, "AP"), "80+95! ");
  EXPECT_EQ(doubtful({0, 100, 118}, "AP"), "100+118! ");
  EXPECT_EQ(doubtful({0, 200, 220}, "AP"), "200+220! ");
  // X-rays of other classes hide nothing.
  EXPECT_EQ(doubtful({0, 60, 75}, "AP", {image("clip", "", 30)}), "60+75! ");
  EXPECT_EQ(doubtful({0, 60, 75}, "AP", {image("copy", "", 2)}), "60+75! ");
  // Whole sessions, near each other, and a single X-ray far from them.
  EXPECT_EQ(doubtful({0, 10, 40, 50, 100, 110}, "AP"), "0+10 40+50 100+110 ");
  EXPECT_EQ(doubtful({0, 10, 300}, "AP"), "0+10 ");
}

// A top that moves on the table need not change its read-outs.
TEST(Sessions, UnmovedReadOutsDoNotSettleWhatARetakeLeavesOpen) {
  const auto at = [](StudyFiles::Image one, double vertical_mm) {
    one = at_table(std::move(one), vertical_mm);
    one.table.longitudinal_mm = 812.0;
    return one;
  };
  const StudyFiles::Image lat = at(image("b", "LAT", 60), -150), ap = at(image("c", "AP", 75), -150);
  EXPECT_THAT(doubts_of({at(image("a", "AP", 0), -150), lat, ap}),
              testing::ElementsAre(testing::HasSubstr("/x/a, 60 s before, has no partner")));
  EXPECT_THAT(doubts_of({at(image("a", "AP", 0), -140), lat, ap}), testing::IsEmpty());
}

TEST(Sessions, AnXrayWithoutItsPartnerMakesItsNeighborsDoubtful) {
  using testing::ElementsAre;
  using testing::HasSubstr;
  // LAT and AP, the couch moves, LAT again, nearer to AP than AP is to the first LAT.
  EXPECT_THAT(doubts_of({image("a", "LAT", 0), image("b", "AP", 60), image("c", "LAT", 88)}),
              ElementsAre(HasSubstr("/x/a, 60 s before, has no partner")));
  // Two imagers whose clocks are five minutes apart: AP and LAT, the couch moves, AP and LAT.
  EXPECT_THAT(doubts_of({image("a", "AP", 0), image("b", "AP", 300), image("c", "LAT", 310), image("d", "LAT", 620)}),
              ElementsAre(HasSubstr("/x/a, 300 s before, has no partner")));
  // A retake long before a pair whose views belong together plainly.
  EXPECT_THAT(doubts_of({image("a", "LAT", 60), image("b", "AP", 300), image("c", "LAT", 310)}), testing::IsEmpty());
  // All with the time of their series.
  EXPECT_THAT(doubts_of({image("a", "AP", 0), image("b", "LAT", 0), image("c", "LAT", 0)}),
              ElementsAre(HasSubstr("another LAT with the time of one of these views")));
}

TEST(Sessions, TwoMachinesAreTwoSessions) {
  StudyFiles::Image other = image("b", "LAT", 10);
  other.machine = "LINAC2";
  EXPECT_THAT(grouped({image("a", "AP", 0), other}), testing::ElementsAre("a", "b"));
}

TEST(Sessions, ThreeViewsInARowStayTogether) {
  EXPECT_THAT(grouped({image("a", "AP", 0), image("b", "LAT", 10), image("c", "OBL", 60), image("d", "AP", 100),
                       image("e", "LAT", 115), image("f", "OBL", 180)}),
              testing::ElementsAre("abc", "def"));
}

TEST(Sessions, WithoutTimesALabelThatIsThereTwiceTellsNothing) {
  using testing::ElementsAre;
  const auto untimed = [](const char* uid, const char* label) { return image(uid, label, std::nullopt); };
  EXPECT_THAT(grouped({untimed("a", "AP"), untimed("b", "LAT")}), ElementsAre("ab"));
  EXPECT_THAT(grouped({untimed("a", "AP"), untimed("b", "LAT"), untimed("c", "LAT")}), ElementsAre("a", "b", "c"));
}

TEST(Sessions, NamesFollowFromTheXraysAlone) {
  StudyFiles one, other;
  one.images = {image("1", "A", 0), image("2", "B", 5)};
  other.images = {image("2", "B", 5), image("1", "A", 0)};
  EXPECT_EQ(sessions_of(one, false)[0].name, sessions_of(other, false)[0].name);
  other.images[0].sop_instance_uid = "3";
  EXPECT_NE(sessions_of(one, false)[0].name, sessions_of(other, false)[0].name);
}

TEST(Sessions, AnAbsentIssuerIsTheOnlyOneThereIs) {
  StudyFiles files;
  files.images = {image("1", "A", 0)};
  files.images[0].patient = "7\\";
  const auto ct_of = [](const std::string& patient) {
    return StudyFiles::Ct{
        .patient = patient, .series_instance_uid = patient, .frame_of_reference_uid = "f", .files = {"a"}};
  };
  files.cts = {ct_of("7\\HOSPITAL"), ct_of("70\\HOSPITAL")};
  const auto own = [&] {
    std::vector<std::string> patients;
    for (const StudyFiles::Ct& ct : files_for(sessions_of(files, false)[0], files).cts) patients.push_back(ct.patient);
    return patients;
  };
  EXPECT_THAT(own(), testing::ElementsAre("7\\HOSPITAL"));
  files.cts.push_back(ct_of("7\\OTHER"));
  EXPECT_THAT(own(), testing::IsEmpty());
  files.cts.push_back(ct_of("7\\"));
  EXPECT_THAT(own(), testing::ElementsAre("7\\"));
  files.images[0].patient = "7\\OTHER";
  EXPECT_THAT(own(), testing::ElementsAre("7\\OTHER"));
}

TEST(Sessions, WhatIsReferredToAndNotThereIsMissing) {
  StudyFiles files;
  files.images = {image("1", "A", 0)};
  EXPECT_THAT(missing_parts(files), testing::ElementsAre("the CT", "the RT Plan 1"));
  files.plans = {
      {.file = "p", .patient = "P", .sop_instance_uid = "1", .frame_of_reference_uid = "f", .structure_set_uid = "s"}};
  files.cts = {{.patient = "P",
                .series_instance_uid = "c",
                .frame_of_reference_uid = "f",
                .files = {"a"},
                .sop_instance_uids = {"a"}}};
  EXPECT_THAT(missing_parts(files), testing::ElementsAre("the RT Structure Set s"));
  files.structures = {{.file = "r",
                       .patient = "P",
                       .sop_instance_uid = "s",
                       .ct_series_uids = {"c"},
                       .ct_sop_instance_uids = {"a", "b"},
                       .frame_of_reference_uids = {"f"}}};
  EXPECT_THAT(missing_parts(files), testing::ElementsAre("1 of the 2 CT images of the RT Structure Set"));
  files.cts[0].sop_instance_uids.insert("b");
  EXPECT_THAT(missing_parts(files), testing::IsEmpty());
}

}  // namespace
}  // namespace isoshift::session_files_test
