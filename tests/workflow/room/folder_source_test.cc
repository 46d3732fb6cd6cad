#include "workflow/room/folder_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "base/error.h"
#include "tests/support/small_study.h"
#include "tests/support/treatment_room.h"

namespace isoshift::folder_source_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class FolderSourceTest : public testing::Test {
 protected:
  FolderSourceTest() {
    fs::copy(study_.path(), in_, fs::copy_options::recursive);
    settle();
  }

  // A file counts once it has not changed between two calls.
  void settle() {
    source_.update(notes_);
    source_.update(notes_);
  }
  bool is_coming() const { return source_.is_coming(source_.patients().begin()->first); }
  const Patient& patient() const { return source_.patients().begin()->second; }
  std::size_t slices() const { return patient().files.cts.at(0).files.size(); }

  const SmallStudy study_;
  const TemporaryFolder folder_;
  const fs::path in_ = folder_ / "in";
  SystemClock clock_;
  FolderSource source_{in_, clock_};
  Notes notes_;
};

TEST_F(FolderSourceTest, TakesAllFilesOfAPatient) {
  ASSERT_EQ(source_.patients().size(), 1U);
  EXPECT_EQ(patient().files.images.size(), 2U);
  EXPECT_EQ(patient().files.plans.size(), 1U);
  EXPECT_GT(slices(), 10U);
  EXPECT_FALSE(is_coming());
  EXPECT_THAT(notes_.warnings, testing::IsEmpty());
}

TEST_F(FolderSourceTest, AnotherPlanWithTheUidOfTheFirstStandsBesideIt) {
  const fs::path other = in_ / "plan2.dcm";
  fs::copy(study_.plan(), other);
  edit(other, [](DicomItem plan) { plan.put(DCM_RTPlanLabel, "another"); });
  settle();
  EXPECT_EQ(patient().files.plans.size(), 2U);
  EXPECT_THROW((void)choose_parts(patient().files), Error);
  fs::remove(other);
  settle();
  EXPECT_EQ(patient().files.plans.size(), 1U);
  EXPECT_NO_THROW((void)choose_parts(patient().files));
}

TEST_F(FolderSourceTest, AFileThatGrowsIsNotTakenYet) {
  fs::copy(study_.plan(), in_ / "plan2.dcm");
  source_.update(notes_);
  EXPECT_TRUE(is_coming());
  std::ofstream(in_ / "plan2.dcm", std::ios::app) << "more";
  source_.update(notes_);
  EXPECT_TRUE(is_coming());
}

TEST_F(FolderSourceTest, AFileThatIsStillZerosIsOnItsWay) {
  std::ofstream(in_ / "plan2.dcm") << std::string(1000, '\0');
  settle();
  EXPECT_TRUE(is_coming());
  fs::copy_file(study_.image(0), in_ / "plan2.dcm", fs::copy_options::overwrite_existing);
  settle();
  EXPECT_FALSE(is_coming());
}

TEST_F(FolderSourceTest, WhatDoesNotArriveWholeIsSaid) {
  ManualClock clock;
  FolderSource source(in_, clock);
  std::ofstream(in_ / "empty.dcm");
  std::ofstream(in_ / "2.25.17") << std::string(1000, '\0');
  std::ofstream(in_ / "cut.dcm") << std::string(100, 'x');
  std::ofstream(in_ / "export.done");
  std::ofstream(in_ / "export.zeros") << std::string(1000, '\0');
  for (int n = 0; n < 3; ++n) source.update(notes_);
  EXPECT_TRUE(source.is_coming("P"));
  EXPECT_THAT(source.unreadable(), testing::ElementsAre(HasSubstr("cut.dcm: is not a DICOM file")));
  clock.pass(std::chrono::seconds(61));
  source.update(notes_);
  EXPECT_FALSE(source.is_coming("P"));
  EXPECT_THAT(source.unreadable(), testing::UnorderedElementsAre(HasSubstr("cut.dcm: is not a DICOM file"),
                                                                 HasSubstr("empty.dcm: has not arrived whole"),
                                                                 HasSubstr("2.25.17: has not arrived whole")));
}

TEST_F(FolderSourceTest, WhatIsOfSomebodyElseOrNoDicomIsNotWaitedFor) {
  std::ofstream(in_ / "export.log") << "exported";
  fs::copy(study_.plan(), in_ / "other.dcm");
  edit(in_ / "other.dcm", [](DicomItem d) {
    d.put(DCM_PatientID, "OTHER");
    d.put(DCM_SOPInstanceUID, "2.25.7");
  });
  source_.update(notes_);
  EXPECT_FALSE(is_coming());
  EXPECT_TRUE(source_.is_coming("OTHER"));
  source_.update(notes_);
  EXPECT_FALSE(source_.is_coming("OTHER"));
  EXPECT_EQ(source_.patients().size(), 2U);
}

TEST_F(FolderSourceTest, AWholeObjectTakesThePlaceOfATruncatedOne) {
  const fs::path slice = in_ / fs::relative(study_.ct_slice(3), study_.path());
  fs::resize_file(slice, fs::file_size(slice) / 2);
  settle();
  const std::size_t before = slices();
  EXPECT_THAT(source_.unreadable(), testing::ElementsAre(HasSubstr("ends before what its elements announce")));
  fs::copy(study_.ct_slice(3), in_ / "again.dcm");
  settle();
  EXPECT_EQ(slices(), before + 1);
  EXPECT_THAT(patient().files.cts.at(0).files, testing::Contains(in_ / "again.dcm"));
  EXPECT_THAT(patient().files.cts.at(0).files, testing::Not(testing::Contains(slice)));
}

TEST_F(FolderSourceTest, SaysWhatCannotBeReadWhileItIsThere) {
  EXPECT_THAT(source_.unreadable(), testing::IsEmpty());
  fs::copy(study_.plan(), in_ / "broken.dcm");
  fs::resize_file(in_ / "broken.dcm", 300);
  settle();
  EXPECT_THAT(source_.unreadable(), testing::ElementsAre(testing::StartsWith((in_ / "broken.dcm").string() + ": ")));
  fs::remove(in_ / "broken.dcm");
  settle();
  EXPECT_THAT(source_.unreadable(), testing::IsEmpty());
}

TEST_F(FolderSourceTest, WhatIsGoneIsForgotten) {
  const std::size_t before = slices();
  fs::remove(in_ / fs::relative(study_.ct_slice(3), study_.path()));
  source_.update(notes_);
  EXPECT_EQ(slices(), before - 1);
  EXPECT_EQ(patient().files.cts.at(0).sop_instance_uids.size(), before - 1);
  fs::remove_all(in_);
  fs::create_directory(in_);
  source_.update(notes_);
  EXPECT_TRUE(source_.patients().empty());
}

TEST_F(FolderSourceTest, ACopyTakesThePlaceOfOneThatIsGone) {
  fs::copy(study_.plan(), in_ / "again.dcm");
  settle();
  EXPECT_EQ(patient().files.plans.size(), 1U);
  fs::remove(in_ / "RTPLAN.dcm");
  settle();
  ASSERT_EQ(patient().files.plans.size(), 1U);
  EXPECT_EQ(patient().files.plans[0].file, in_ / "again.dcm");
  EXPECT_THAT(notes_.warnings, testing::IsEmpty());
}

TEST_F(FolderSourceTest, AnotherObjectOfOneUidIsAnAlarm) {
  fs::copy(study_.plan(), in_ / "other.dcm");
  edit(in_ / "other.dcm", [](DicomItem d) { d.put(DCM_RTPlanLabel, "OTHER"); });
  settle();
  EXPECT_EQ(patient().files.plans.size(), 2U) << "which of the two is meant, nothing tells";
  EXPECT_THAT(notes_.warnings, testing::ElementsAre(HasSubstr("has the same SOPInstanceUID")));
}

TEST_F(FolderSourceTest, AnotherXrayOfOneUidIsNotedInTheFirst) {
  fs::copy(study_.image(0), in_ / "other.dcm");
  edit(in_ / "other.dcm", [](DicomItem d) { d.put(DCM_AcquisitionTime, "101700"); });
  settle();
  const auto others = [&] {
    std::vector<fs::path> found;
    for (const StudyFiles::Image& image : patient().files.images)
      if (!image.other.empty()) found.push_back(image.other);
    return found;
  };
  EXPECT_THAT(others(), testing::ElementsAre(in_ / "other.dcm"));
  fs::copy(study_.image(0), in_ / "copy.dcm");
  settle();
  fs::remove(in_ / "copy.dcm");
  settle();
  EXPECT_THAT(others(), testing::ElementsAre(in_ / "other.dcm"));
  fs::remove(in_ / "other.dcm");
  settle();
  EXPECT_THAT(others(), testing::IsEmpty());
}

TEST_F(FolderSourceTest, AnotherContentUnderANameReplacesTheFirst) {
  edit(in_ / "RTPLAN.dcm", [](DicomItem d) { d.put(DCM_SOPInstanceUID, "2.25.7"); });
  settle();
  ASSERT_EQ(patient().files.plans.size(), 1U);
  EXPECT_EQ(patient().files.plans[0].sop_instance_uid, "2.25.7");
}

}  // namespace
}  // namespace isoshift::folder_source_test
