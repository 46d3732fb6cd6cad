#include "workflow/room/clock_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/treatment_room.h"

namespace isoshift::clock_comparison_test {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class ClockComparisonTest : public testing::Test {
 protected:
  ClockComparisonTest() { clocks_.update(patients_, kNow); }

  // An X-ray that was taken so long ago by the machine's clock arrives now.
  void take(double age_s, const std::string& machine = "Linac 3", bool has_utc_offset = true) {
    StudyFiles one = xray("P", std::to_string(++count_), "AP", 0.0);
    one.images[0].machine = machine;
    one.images[0].has_utc_offset = has_utc_offset;
    one.images[0].at_s = kNow.time_since_epoch().count() - age_s;
    Patient& patient = patients_["P"];
    merge(one, patient.files);
    patient.last += 1s;
    clocks_.update(patients_, kNow);
  }

  static constexpr ClockComparison::SystemTime kNow{std::chrono::duration<double>(1772409600.0)};
  std::map<std::string, Patient> patients_;
  ClockComparison clocks_;
  int count_ = 0;
};

TEST_F(ClockComparisonTest, AnXrayFromTheFutureShowsAClockThatIsAhead) {
  take(-20.0);
  EXPECT_EQ(clocks_.beyond(30.0), "");
  take(-95.0);
  EXPECT_THAT(clocks_.beyond(30.0), HasSubstr("Linac 3: its clock is at least 95 s ahead"));
  for (int n = 0; n < 3; ++n) take(5.0);
  EXPECT_EQ(clocks_.beyond(30.0), "") << "it has been set right";
}

TEST_F(ClockComparisonTest, OneLateXrayShowsNothingAndThreeDo) {
  take(400.0);
  take(350.0);
  EXPECT_EQ(clocks_.beyond(60.0), "");
  take(300.0);
  EXPECT_THAT(clocks_.beyond(60.0), HasSubstr("came 300 s and more after they were taken"));
  take(10.0);
  EXPECT_EQ(clocks_.beyond(60.0), "");
}

TEST_F(ClockComparisonTest, EveryMachineHasItsOwnClock) {
  take(-100.0, "A");
  take(3.0, "B");
  EXPECT_THAT(clocks_.beyond(60.0), AllOf(HasSubstr("A: "), Not(HasSubstr("B: "))));
  take(-200.0, "");
  EXPECT_THAT(clocks_.beyond(60.0), HasSubstr("a machine without a name: its clock is at least 200 s"));
}

TEST_F(ClockComparisonTest, WhatWasThereBeforeTellsNothing) {
  ClockComparison later;
  for (int n = 0; n < 3; ++n) take(5000.0);
  later.update(patients_, kNow);
  EXPECT_EQ(later.beyond(60.0), "");
  EXPECT_NE(clocks_.beyond(60.0), "");
}

TEST_F(ClockComparisonTest, ATimeWithoutAnOffsetIsLocal) {
  const char* const zone = std::getenv("TZ");
  const std::string before = zone == nullptr ? "" : zone;
  ::setenv("TZ", "UTC-3", 1);  // three hours ahead of UTC
  ::tzset();
  take(-3 * 3600.0 + 5.0, "Linac 3", false);
  EXPECT_EQ(clocks_.beyond(60.0), "");
  before.empty() ? ::unsetenv("TZ") : ::setenv("TZ", before.c_str(), 1);
  ::tzset();
}

TEST(WatchComparesClocks, AndNotOfWhatWasThereBefore) {
  TreatmentRoom room;
  room.file.site.sessions->max_clock_offset_s = 60.0;
  for (int n = 0; n < 4; ++n) room.source.bring(xray("P", std::to_string(n), "AP", 60.0 * n));
  room.source.set_coming(true);
  room.start();
  room.pass(30s);
  room.source.bring(xray("P", "4", "AP", 300.0));
  room.source.set_coming(false);
  room.pass(30s);
  EXPECT_THAT(room.index(), Not(HasSubstr("comparing clocks")));
}

TEST(WatchComparesClocks, AndSaysSoOnItsPage) {
  TreatmentRoom room;
  room.file.site.sessions->max_clock_offset_s = 60.0;
  room.start();
  room.pass(2s);
  StudyFiles one = xray("P", "ap", "AP", 0.0);
  const ClockComparison::SystemTime now = std::chrono::file_clock::to_sys(room.clock.file_time());
  one.images[0].has_utc_offset = true;
  one.images[0].at_s = now.time_since_epoch().count() + 600.0;
  room.source.bring(one);
  room.pass(5s);
  EXPECT_THAT(room.index(), HasSubstr("comparing clocks: a machine without a name: its clock is at least 599 s ahead"));
}

}  // namespace
}  // namespace isoshift::clock_comparison_test
