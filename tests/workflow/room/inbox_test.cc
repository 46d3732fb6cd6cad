#include "workflow/room/inbox.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/small_study.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class InboxTest : public testing::Test {
 protected:
  InboxTest() {
    watch_.folder = folder_ / "in";
    fs::copy(study_.path(), watch_.folder, fs::copy_options::recursive);
    inbox_ = std::make_unique<Inbox>(watch_, folder_ / "objects");
    settle();
  }

  // A file counts once it has not changed between two calls.
  void settle() {
    inbox_->update(notes_);
    inbox_->update(notes_);
  }
  bool is_coming() const { return inbox_->is_coming(inbox_->patients().begin()->first); }
  const Inbox::Patient& patient() const { return inbox_->patients().begin()->second; }
  std::size_t slices() const { return patient().files.cts.at(0).files.size(); }

  const SmallStudy study_;
  const TemporaryFolder folder_;
  WatchFile watch_;
  Notes notes_;
  std::unique_ptr<Inbox> inbox_;
};

TEST_F(InboxTest, TakesAllFilesOfAPatient) {
  ASSERT_EQ(inbox_->patients().size(), 1U);
  EXPECT_EQ(patient().files.images.size(), 2U);
  EXPECT_EQ(patient().files.plans.size(), 1U);
  EXPECT_GT(slices(), 10U);
  EXPECT_FALSE(is_coming());
  EXPECT_THAT(notes_.warnings, testing::IsEmpty());
}

TEST_F(InboxTest, AFileThatGrowsIsNotTakenYet) {
  fs::copy(study_.plan(), watch_.folder / "plan2.dcm");
  inbox_->update(notes_);
  EXPECT_TRUE(is_coming());
  std::ofstream(watch_.folder / "plan2.dcm", std::ios::app) << "more";
  inbox_->update(notes_);
  EXPECT_TRUE(is_coming());
}

TEST_F(InboxTest, WhatIsOfSomebodyElseOrNoDicomIsNotWaitedFor) {
  std::ofstream(watch_.folder / "export.log") << "exported";
  fs::copy(study_.plan(), watch_.folder / "other.dcm");
  edit(watch_.folder / "other.dcm", [](DicomItem d) {
    d.put(DCM_PatientID, "OTHER");
    d.put(DCM_SOPInstanceUID, "2.25.7");
  });
  inbox_->update(notes_);
  EXPECT_FALSE(is_coming());
  EXPECT_TRUE(inbox_->is_coming("OTHER"));
  inbox_->update(notes_);
  EXPECT_FALSE(inbox_->is_coming("OTHER"));
  EXPECT_EQ(inbox_->patients().size(), 2U);
}

TEST_F(InboxTest, AWholeObjectTakesThePlaceOfATruncatedOne) {
  const fs::path slice = watch_.folder / fs::relative(study_.ct_slice(3), study_.path());
  fs::resize_file(slice, fs::file_size(slice) / 2);
  settle();
  const std::size_t before = slices();
  fs::copy(study_.ct_slice(3), watch_.folder / "again.dcm");
  settle();
  EXPECT_EQ(slices(), before);
  EXPECT_THAT(patient().files.cts.at(0).files, testing::Contains(watch_.folder / "again.dcm"));
  EXPECT_THAT(patient().files.cts.at(0).files, testing::Not(testing::Contains(slice)));
}

TEST_F(InboxTest, WhatIsGoneIsForgotten) {
  const std::size_t before = slices();
  fs::remove(watch_.folder / fs::relative(study_.ct_slice(3), study_.path()));
  inbox_->update(notes_);
  EXPECT_EQ(slices(), before - 1);
  EXPECT_EQ(patient().files.cts.at(0).sop_instance_uids.size(), before - 1);
  fs::remove_all(watch_.folder);
  fs::create_directory(watch_.folder);
  inbox_->update(notes_);
  EXPECT_TRUE(inbox_->patients().empty());
}

TEST_F(InboxTest, ACopyTakesThePlaceOfOneThatIsGone) {
  fs::copy(study_.plan(), watch_.folder / "again.dcm");
  settle();
  EXPECT_EQ(patient().files.plans.size(), 1U);
  fs::remove(watch_.folder / "RTPLAN.dcm");
  settle();
  ASSERT_EQ(patient().files.plans.size(), 1U);
  EXPECT_EQ(patient().files.plans[0].file, watch_.folder / "again.dcm");
  EXPECT_THAT(notes_.warnings, testing::IsEmpty());
}

TEST_F(InboxTest, AnotherObjectOfOneUidIsAnAlarm) {
  fs::copy(study_.plan(), watch_.folder / "other.dcm");
  edit(watch_.folder / "other.dcm", [](DicomItem d) { d.put(DCM_RTPlanLabel, "OTHER"); });
  settle();
  EXPECT_EQ(patient().files.plans.size(), 1U);
  EXPECT_THAT(notes_.warnings, testing::ElementsAre(HasSubstr("has the same SOPInstanceUID")));
}

TEST_F(InboxTest, AnotherContentUnderANameReplacesTheFirst) {
  edit(watch_.folder / "RTPLAN.dcm", [](DicomItem d) { d.put(DCM_SOPInstanceUID, "2.25.7"); });
  settle();
  ASSERT_EQ(patient().files.plans.size(), 1U);
  EXPECT_EQ(patient().files.plans[0].sop_instance_uid, "2.25.7");
}

}  // namespace
}  // namespace isoshift
