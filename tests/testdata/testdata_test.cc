// testdata/ keeps what its READMEs promise: they are read here, so that a table cannot say what is not so. Whether its
// files can be made again: tests/testdata/remake.sh.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>
#include <sstream>

#include "geometry/target_error.h"
#include "io/config/machine_profile.h"
#include "io/config/site_file.h"
#include "io/config/watch_file.h"
#include "io/dicom/decode.h"
#include "io/report/result_folder.h"
#include "io/study/motion_trace.h"
#include "io/study/study.h"
#include "tests/support/command.h"
#include "tests/support/pose_near.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/testdata.h"
#include "workflow/register/truth.h"

namespace isoshift::testdata_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// The names in a folder, without its README.
std::set<std::string> names_in(const fs::path& folder) {
  std::set<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename());
  names.erase("README.md");
  return names;
}

// Text as the tables have it: paths from the repository's root, every gap one space.
std::string as_in_table(std::string text) {
  const std::string root = std::string(ISOSHIFT_SOURCE_DIR) + "/";
  for (auto at = text.find(root); at != std::string::npos; at = text.find(root)) text.erase(at, root.size());
  std::istringstream words(text);
  std::string joined;
  for (std::string word; words >> word;) joined += (joined.empty() ? "" : " ") + word;
  return joined;
}

class TestdataStudies : public testing::TestWithParam<const char*> {};

TEST_P(TestdataStudies, HoldWhatTheirReadmesSay) {
  const fs::path folder = testdata(GetParam());
  for (const auto& row : table_of(folder / "README.md"))
    EXPECT_TRUE(fs::exists(folder / code_in(row.at(0)).at(0))) << row.at(0);
  Notes notes;
  StudyRequest request;
  request.parts.study = folder;
  const Study study = load_study(request, notes, {});
  EXPECT_THAT(table_of(folder / "README.md").at(0).at(1), HasSubstr(fmt::format("{} slices", study.ct->hu.size.z())));
  EXPECT_EQ(study.xrays.size(), 2U);
  EXPECT_EQ(study.plan->label, "SETUP");
  ASSERT_TRUE(study.structures);
  EXPECT_EQ(structure_named(*study.structures, "Target").interpreted_type, "GTV");
  EXPECT_TRUE(notes.warnings.empty()) << testing::PrintToString(notes.warnings);
}

INSTANTIATE_TEST_SUITE_P(All, TestdataStudies, testing::Values("head", "spine", "thorax"),
                         [](const auto& param) { return std::string(param.param); });

class TestdataRegistrations : public testing::TestWithParam<std::string> {};

// What another program would apply: the couch shift that check reads from the object undoes the true setup error.
TEST_P(TestdataRegistrations, MeanTheTruth) {
  const fs::path folder = testdata("registrations") / GetParam();
  const CommandOutcome outcome = run_command({"check", (folder / "spatial_registration.dcm").string(), "--plan",
                                              (folder / "RTPLAN.dcm").string(), "--couch-angle", "0", "--json"});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.out << outcome.err;
  const auto shift = nlohmann::json::parse(outcome.out)["registrations"][0]["couch_shift"];
  const Eigen::Vector3d moved_mm(shift["lateral_mm"], shift["longitudinal_mm"], shift["vertical_mm"]);
  const Eigen::Isometry3d truth = read_setup_error(folder / "truth.json");
  EXPECT_THAT(moved_mm, VectorNear(-truth.translation(), 1.0));
  // The couch turns the patient back: yaw about z, pitch about x, roll about y.
  const auto expected = nlohmann::json::parse(std::ifstream(folder / "truth.json"))["setup_error_room"];
  const auto& deg = expected["rotation_deg_rx_ry_rz"];
  EXPECT_NEAR(shift["pitch_deg"], -deg[0].get<double>(), 0.6);
  EXPECT_NEAR(shift["roll_deg"], -deg[1].get<double>(), 0.6);
  EXPECT_NEAR(shift["yaw_deg"], -deg[2].get<double>(), 0.6);
}

INSTANTIATE_TEST_SUITE_P(All, TestdataRegistrations, testing::ValuesIn(names_in(testdata("registrations"))),
                         [](const auto& param) { return param.param; });

TEST(TestdataRegistrationsReadme, NamesEveryFolder) {
  std::set<std::string> named;
  for (const auto& row : table_of(testdata("registrations/README.md")))
    for (const std::string& name : code_in(row.at(0))) named.insert(name);
  EXPECT_EQ(named, names_in(testdata("registrations")));
}

class TestdataDialects : public testing::Test {
 protected:
  // Registers a dialect with the CT and plan of small/1.
  CommandOutcome registered(const std::string& dialect, const std::vector<std::string>& switches) {
    std::vector<std::string> arguments = arguments_of(
        fmt::format("register testdata/rt-images/{} --ct testdata/small/1/CT --plan testdata/small/1/RTPLAN.dcm "
                    "--preset fast --dof translation --overwrite -o {}",
                    dialect, output().string()));
    arguments.insert(arguments.end(), switches.begin(), switches.end());
    return run_command(arguments);
  }
  // The setup error of the last registration.
  Eigen::Isometry3d found() const { return read_setup_error(output() / "result.json"); }
  fs::path output() const { return folder_ / "result"; }

  TemporaryFolder folder_;
};

// Every dialect shows the same patient in the same place, to 0.13 mm at the isocenter: the sag of one panel.
TEST_F(TestdataDialects, AreRegisteredOrRefusedAsTheTableSays) {
  ASSERT_EQ(registered("mosaiq-complete", {}).exit_status, 3);  // the preset leaves a check out
  const Eigen::Isometry3d expected = found();
  std::set<std::string> named;
  for (const auto& row : table_of(testdata("rt-images/README.md"))) {
    const std::string dialect = code_in(row.at(0)).at(0), as_it_is = row.at(2);
    SCOPED_TRACE(dialect);
    named.insert(dialect);
    const CommandOutcome plain = registered(dialect, {});
    if (as_it_is == "registered") {
      EXPECT_EQ(plain.exit_status, 3) << plain.err;
      EXPECT_THAT(found(), PoseNear(expected, 0.3, 0.0));
      continue;
    }
    if (as_it_is == "registered elsewhere") {
      EXPECT_THAT(plain.exit_status, testing::AnyOf(3, 4)) << plain.err;
      EXPECT_THAT(found(), testing::Not(PoseNear(expected, 5.0, 0.0)));
    } else {
      EXPECT_EQ(plain.exit_status, 1);
      EXPECT_THAT(plain.err, HasSubstr(as_it_is));
    }
    const CommandOutcome supplied = registered(dialect, arguments_of(code_in(row.at(3)).at(0)));
    EXPECT_EQ(supplied.exit_status, 3) << supplied.err;
    EXPECT_THAT(found(), PoseNear(expected, 0.3, 0.0));
  }
  EXPECT_EQ(named, names_in(testdata("rt-images")));
}

TEST(TestdataCompressed, EveryTransferSyntaxHasTheSamePixels) {
  const auto pixels_of = [](const fs::path& path) {
    const DicomFile file = DicomFile::read(path, DicomFile::Extent::kWhole);
    return decode_frame(file, pixel_format(file.dataset()), 0);
  };
  const auto expected = pixels_of(testdata("small/1/CT/CT0018.dcm"));
  std::set<std::string> named;
  for (const auto& row : table_of(testdata("compressed/README.md"))) {
    named.insert(code_in(row.at(0)).at(0));
    EXPECT_EQ(pixels_of(testdata("compressed") / code_in(row.at(0)).at(0)), expected) << row.at(0);
  }
  EXPECT_EQ(named, names_in(testdata("compressed")));
}

TEST(TestdataBreathing, IsReadInEveryFormat) {
  Notes notes;
  const auto phantom = read_motion_trace(testdata("breathing/phantom.csv"), notes);
  EXPECT_EQ(phantom.size(), 240U);
  EXPECT_GE(read_motion_trace(testdata("breathing/tracked.csv"), notes).size(), 25U);
  EXPECT_TRUE(notes.warnings.empty());
  const auto markers = read_motion_trace(testdata("breathing/markers.csv"), notes);
  EXPECT_THAT(notes.warnings, testing::ElementsAre(HasSubstr("1 of 240 rows have a time before")));
  ASSERT_EQ(markers.size(), 239U);
  for (const MotionSample& sample : markers)
    EXPECT_THAT(sample.position_mm, VectorNear(position_at(phantom, sample.time_s).value(), 0.09)) << sample.time_s;
}

TEST(TestdataConfig, EveryFileIsRead) {
  std::set<std::string> named, there;
  for (const auto& row : table_of(testdata("config/README.md"))) named.insert(code_in(row.at(0)).at(0));
  for (const std::string kind : {"site", "machine", "watch"})
    for (const std::string& name : names_in(testdata("config") / kind)) {
      const fs::path path = testdata("config") / kind / name;
      there.insert(fmt::format("{}/{}", kind, name));
      if (kind == "site") {
        EXPECT_FALSE(read_site_file(path).name.empty()) << name;
      } else if (kind == "machine") {
        EXPECT_FALSE(read_machine_profile(path).rules.empty()) << name;
      } else {
        EXPECT_EQ(read_watch_file(path).site.name, "Linac 3") << name;
      }
    }
  EXPECT_EQ(named, there);
}

TEST(TestdataDamaged, EveryFileIsRefusedWithTheMessageOfTheTable) {
  const TemporaryFolder folder;
  std::set<std::string> named;
  for (const auto& row : table_of(testdata("damaged/README.md"))) {
    SCOPED_TRACE(row.at(0));
    named.insert(fs::path(code_in(row.at(0)).at(0)).begin()->string());
    std::vector<std::string> arguments = arguments_of(code_in(row.at(2)).at(0));
    std::ranges::replace(arguments, "OUT", (folder / "out").string());
    const CommandOutcome outcome = run_command(arguments);
    EXPECT_EQ(outcome.exit_status, 1);
    const std::string message = as_in_table(outcome.out + outcome.err);
    if (const auto words_of_dcmtk = row.at(3).find("..."); words_of_dcmtk != std::string::npos)
      EXPECT_THAT(message, testing::StartsWith(row.at(3).substr(0, words_of_dcmtk)));
    else
      EXPECT_EQ(message, row.at(3));
    EXPECT_FALSE(fs::exists(folder / "out"));
  }
  EXPECT_EQ(named, names_in(testdata("damaged")));
}

class TestdataResults : public testing::TestWithParam<std::string> {
 protected:
  fs::path result(const std::string& name) const { return testdata("results") / GetParam() / name; }
};

TEST_P(TestdataResults, AreReadAndReportedAgain) {
  const TemporaryFolder folder;
  for (const std::string verdict : {"accepted", "review", "rejected"}) {
    SCOPED_TRACE(verdict);
    const SetupResult read = read_result(result(verdict));
    EXPECT_EQ(to_string(read.verdict()), verdict);
    EXPECT_EQ(read.version, GetParam());
    EXPECT_EQ(read.views.size(), 2U);
    EXPECT_EQ(read.reasons().empty(), verdict == "accepted");
    const fs::path again = folder / verdict;
    const CommandOutcome outcome = run_command({"report", result(verdict).string(), "-o", again.string(), "--site",
                                                testdata("config/site/linac.json").string(), "--anatomy", "head"});
    ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
    for (const char* name : {"report.pdf", "report.html", "report.txt", "report.csv", "report.dcm", "view2.png"})
      EXPECT_GT(fs::file_size(again / name), 100U) << name;
    const SetupResult written = read_result(again);
    EXPECT_TRUE(written.setup_error.isApprox(read.setup_error, 1e-12));
    EXPECT_EQ(written.site->name, "Linac 3");
  }
}

TEST_P(TestdataResults, HaveARegistrationObjectUnlessRejected) {
  for (const std::string verdict : {"accepted", "review"}) {
    const std::string study = verdict == "accepted" ? "head" : "spine";
    const CommandOutcome outcome = run_command({"check", (result(verdict) / kRegistrationFile).string(), "--plan",
                                                testdata(study + "/RTPLAN.dcm").string(), "--json"});
    ASSERT_EQ(outcome.exit_status, 0) << outcome.out << outcome.err;
    const auto object = nlohmann::json::parse(outcome.out)["registrations"][0]["couch_shift"];
    const auto report = nlohmann::json::parse(std::ifstream(result(verdict) / kResultFile))["couch_shift"];
    for (const char* axis : {"lateral_mm", "longitudinal_mm", "vertical_mm", "yaw_deg", "pitch_deg", "roll_deg"})
      EXPECT_NEAR(object[axis].get<double>(), report[axis].get<double>(), 1e-6) << axis;
    EXPECT_LT(
        mean_target_registration_error_mm(read_setup_error(result(verdict) / kResultFile),
                                          read_setup_error(testdata(study + "/truth.json")), standard_targets_mm()),
        0.5);
  }
  EXPECT_FALSE(fs::exists(result("rejected") / kRegistrationFile));
}

TEST_P(TestdataResults, HoldAnEvaluation) {
  const CommandOutcome outcome = run_command({"evaluate", "--table", result("evaluation").string()});
  EXPECT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_THAT(outcome.out, HasSubstr("/4 ("));
}

INSTANTIATE_TEST_SUITE_P(All, TestdataResults, testing::ValuesIn(names_in(testdata("results"))), [](const auto& param) {
  std::string name = "v" + param.param;
  std::ranges::replace(name, '.', '_');
  return name;
});

}  // namespace
}  // namespace isoshift::testdata_test
