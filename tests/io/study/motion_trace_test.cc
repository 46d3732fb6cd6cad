#include "io/study/motion_trace.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::motion_trace_test {
namespace {

using testing::HasSubstr;

class MotionTraceTest : public testing::Test {
 protected:
  std::vector<MotionSample> read(const std::string& text) {
    std::ofstream(path_, std::ios::trunc) << text;
    return read_motion_trace(path_, notes_);
  }
  std::string error_of(const std::string& text) {
    try {
      read(text);
    } catch (const Error& error) {
      return error.what();
    }
    return "no error";
  }

  TemporaryFolder folder_;
  std::filesystem::path path_ = folder_ / "trace.csv";
  Notes notes_;
};

TEST_F(MotionTraceTest, ReadsSemicolonsDecimalCommasAndMilliseconds) {
  const auto trace = read(
      "\"Frame\";\"Timestamp\";\"x\";\"y\";\"z\"\r\n0;0;-490,7;4,1;64,7\r\n7;117;-490,5;4,3;64,2\r\n0;0;0;0;0\r\n0;0;0;"
      "0;0\r\n");
  ASSERT_EQ(trace.size(), 2U);
  EXPECT_EQ(trace[1].time_s, 0.117);
  EXPECT_EQ(trace[1].position_mm, Eigen::Vector3d(-490.5, 4.3, 64.2));
}

TEST_F(MotionTraceTest, ReadsTheTraceOfTrack) {
  const auto trace =
      read("t_s,measured_x_mm,measured_y_mm,measured_z_mm,status\n0,1,2,3,measured\n0.2,,,,late\n0.4,2,3,4,measured\n");
  ASSERT_EQ(trace.size(), 2U);
  EXPECT_EQ(trace[1].position_mm, Eigen::Vector3d(2, 3, 4));
}

TEST_F(MotionTraceTest, CurvesOfGatingSystemsAreNamed) {
  EXPECT_THAT(
      error_of("[Header]\nCRC=0\nData_layout=amplitude,phase,timestamp,validflag,ttlin,mark,ttlout\n[Data]\n"
               "0.6,0,111424,0,0,,0\n"),
      testing::AllOf(HasSubstr("expected t_s (or Timestamp, in ms) and x, y, z"), HasSubstr("Varian RPM (.vxp)")));
  EXPECT_THAT(error_of("Gestartet: 01.03.2026, 10:15:00\n\nZeit [s]\tAmplitude [cm]\n0,00\t0,000\n"),
              HasSubstr("the breathing curve of a gating system"));
}

TEST_F(MotionTraceTest, AStandstillOfSecondsIsSaid) {
  const auto trace = [](int from, int to) {
    std::string text = "t_s,x,y,z\n";
    for (int n = 0; n < 200; ++n) {
      const double x = std::sin(0.1 * (n > from && n < to ? from : n));
      text += fmt::format("{:.1f},{:.4f},0,{:.4f}\n", 0.1 * n, x, 5.0 * x);
    }
    return text;
  };
  read(trace(100, 121));
  EXPECT_TRUE(notes_.warnings.empty()) << "2 s";
  read(trace(100, 161));
  EXPECT_THAT(notes_.warnings,
              testing::ElementsAre(HasSubstr("stands still to the last digit for 6.0 s, from 10.0 s on")));
}

TEST_F(MotionTraceTest, AnAxisThatStandsStillWhileTheOthersMoveIsSaid) {
  const auto trace = [](int from, int to, double digit) {
    std::string text = "t_s,x,y,z\n";
    for (int n = 0; n < 200; ++n) {
      const double x = std::sin(0.1 * n), z = std::sin(0.1 * (n > from && n < to ? from : n));
      text += fmt::format("{:.1f},{:.4f},7,{:.4f}\n", 0.1 * n, x, digit * std::round(z / digit));
    }
    return text;
  };
  read(trace(100, 121, 1e-4));
  EXPECT_TRUE(notes_.warnings.empty()) << "2 s";
  read(trace(0, 0, 2.0));
  EXPECT_TRUE(notes_.warnings.empty()) << "a coarse axis rests now and then";
  read(trace(100, 161, 1e-4));
  EXPECT_THAT(notes_.warnings,
              testing::ElementsAre(
                  HasSubstr("z, while the others move, stands still to the last digit for 6.0 s, from 10.0 s on")));
}

// Recorders write -999 or the like, or go on with another marker.
TEST_F(MotionTraceTest, PositionsThatNothingInABodyReachesAreWarnedOf) {
  const auto trace = [](double at_10_s) {
    std::string text = "t_s,x,y,z\n";
    for (int n = 0; n < 200; ++n)
      text += fmt::format("{:.1f},{:.3f},2,3\n", 0.1 * n, n == 100 ? at_10_s : 5.0 * std::sin(0.3 * n));
    return text;
  };
  read(trace(5.0 * std::sin(30.0) + 8.0));
  EXPECT_TRUE(notes_.warnings.empty()) << "a cough";
  read(trace(-999.0));
  EXPECT_THAT(notes_.warnings,
              testing::ElementsAre(HasSubstr("jumps 2 times by 10 mm or more, first by 994 mm in 0.100 s, at 10.0 s")));
}

TEST_F(MotionTraceTest, ASingleWrongTimeIsLeftOutWithAWarning) {
  std::string text = "t_s,x,y,z\n";
  for (int n = 0; n < 200; ++n) text += (n == 100 ? "3" : std::to_string(n)) + ",1,2,3\n";
  EXPECT_EQ(read(text).size(), 199U);
  EXPECT_THAT(notes_.warnings, testing::ElementsAre(HasSubstr("1 of 200 rows have a time before")));
}

TEST_F(MotionTraceTest, MistakesAreNamed) {
  EXPECT_THAT(error_of("a,b\n1,2\n"), HasSubstr("has the columns a, b; expected t_s"));
  EXPECT_THAT(error_of("t_s,x,y,z\n0,1,2,3\n1,1,two,3\n"), HasSubstr("line 3: \"two\" is not a number"));
  EXPECT_THAT(error_of("t_s,x,y,z\n0,1,2,3\n,1,2,3\n"), HasSubstr("line 3: has no time"));
  EXPECT_THAT(error_of("t_s,x,y,z\n5,1,2,3\n4,1,2,3\n3,1,2,3\n"),
              HasSubstr("the times of 2 of 3 rows do not increase"));
  EXPECT_THAT(error_of(""), HasSubstr("is empty"));
  EXPECT_THAT(error_of("t_s,x,y,z\n0,1,2,3\n1,1,,3\n"), HasSubstr("line 3: has 2 of 3 coordinates"));
  EXPECT_THAT(error_of("t_s,x,y,z\n0,1,1e300,3\n"), HasSubstr("line 2: y is 1e+300 mm, expected -10000 to 10000"));
  EXPECT_THAT(error_of("t_s,x,x_mm,y,z\n0,1,1,2,3\n"), HasSubstr("has the columns x and x_mm, expected one of them"));
  EXPECT_THAT(error_of("\xFF\xFEt"), HasSubstr("is in UTF-16, expected UTF-8"));
  EXPECT_EQ(read("t_s,x,y,z\r0,1,2,3\r1,2,3,4\r").size(), 2U);
}

TEST_F(MotionTraceTest, PredictRefusesGapsAndTimesInAnotherUnit) {
  const auto error_with = [&](const char* title, double step, int gap_at) {
    std::string text = fmt::format("{},x,y,z\n", title);
    for (int n = 0; n < 1000; ++n)
      text += fmt::format("{},0,{},0\n", step * n + (gap_at > 0 && n > gap_at ? 1e7 : 0.0), std::sin(0.1 * n));
    read(text);
    const CommandOutcome outcome = run_command({"predict", path_.string(), "--train-s", "1"});
    EXPECT_EQ(outcome.exit_status, 1);
    return outcome.err;
  };
  EXPECT_THAT(error_with("t_s", 0.1, 500), HasSubstr("has no position for 1e+07 s after 50 s"));
  EXPECT_THAT(error_with("t_s", 100.0, 0), HasSubstr("has no position for 100 s after 0 s"));
  EXPECT_THAT(error_with("Timestamp", 0.1, 0), HasSubstr("has 1000 positions within 0.0999 s"));
}

TEST_F(MotionTraceTest, PredictScoresTracesAndWritesAChart) {
  std::string text = "t_s,x,y,z\n";
  for (int n = 0; n < 1200; ++n) text += fmt::format("{},0,{},0\n", 0.1 * n, 5.0 * std::sin(1.5 * 0.1 * n));
  read(text);
  const std::string output = (folder_ / "out").string();
  const CommandOutcome outcome =
      run_command({"predict", path_.string(), "--latency", "200,400", "-o", output, "--json"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  const auto json = nlohmann::json::parse(outcome.out);
  EXPECT_GT(json["trace"]["hold-last"]["200"]["rmse_mm"], 0.5);
  EXPECT_LT(json["trace"]["rls"]["400"]["rmse_mm"], 0.2);
  EXPECT_TRUE(std::filesystem::exists(folder_ / "out" / "prediction.svg"));
  EXPECT_THAT(run_command({"predict", path_.string()}).out, HasSubstr("hold-last"));
  EXPECT_EQ(run_command({"predict", path_.string(), "--latency", "-3"}).exit_status, 2);
  EXPECT_EQ(run_command({"predict", path_.string(), "--train-s", "3600"}).exit_status, 1);
}

}  // namespace
}  // namespace isoshift::motion_trace_test
