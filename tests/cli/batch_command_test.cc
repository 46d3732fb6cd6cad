// Many studies: registered once each, whatever happens in between.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/output_folder.h"
#include "base/process.h"
#include "base/text_file.h"
#include "geometry/imager_error.h"
#include "tests/support/small_study.h"
#include "tests/support/testdata.h"
#include "workflow/batch/batch.h"
#include "workflow/batch/batch_folder.h"
#include "workflow/batch/batch_manifest.h"

namespace isoshift::batch_command_test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class BatchCommandTest : public testing::Test {
 protected:
  BatchCommandTest() {
    for (const char* patient : {"1", "2"}) {
      fs::create_directories(exported() / patient);
      fs::copy(testdata("small") / patient, exported() / patient, fs::copy_options::recursive);
    }
  }
  ~BatchCommandTest() override { use_program(ISOSHIFT_PROGRAM); }

  fs::path exported() const { return folder_ / "exported"; }
  fs::path results() const { return folder_ / "results"; }
  CommandOutcome batch(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> arguments = {"batch", exported().string(), "-o", results().string(), "--preset", "fast"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_command(arguments);
  }
  nlohmann::json summary() const { return nlohmann::json::parse(std::ifstream(results() / "summary.json")); }
  // Results by case, without what differs from run to run.
  std::map<std::string, nlohmann::json> cases() const {
    std::map<std::string, nlohmann::json> all;
    for (const auto& entry : fs::directory_iterator(results() / "cases")) {
      nlohmann::json json = nlohmann::json::parse(std::ifstream(entry.path() / "result.json"));
      json.erase("seconds");
      json.erase("made_on");
      json["references"].erase("spatial_registration");
      for (auto& stage : json["stages"]) stage.erase("seconds");
      all[entry.path().filename()] = json;
    }
    return all;
  }

  TemporaryFolder folder_;
};

TEST_F(BatchCommandTest, RegistersEverySessionOnceAndGoesOn) {
  const CommandOutcome outcome = batch({"--jobs", "2"});
  EXPECT_EQ(outcome.exit_status, 4) << outcome.err;
  EXPECT_EQ(summary()["cases"].size(), 4U);
  for (const char* file : {"index.html", "patients.html", "summary.csv", "manifest.csv", "batch.json"})
    EXPECT_TRUE(fs::exists(results() / file)) << file;
  const auto before = cases();
  ASSERT_EQ(before.size(), 4U);

  // What is there is not made again; what is not, is, and is the same.
  const auto kept = fs::last_write_time(results() / "cases" / before.begin()->first / "result.json");
  const std::string lost = before.rbegin()->first;
  fs::remove_all(results() / "cases" / lost);
  fs::create_directories(results() / "cases" / (lost + ".partial-abcdef"));  // of a run that was killed
  const CommandOutcome again = batch();
  EXPECT_THAT(again.err, HasSubstr("3 of 4 cases have been registered before"));
  EXPECT_EQ(cases(), before);
  EXPECT_EQ(fs::last_write_time(results() / "cases" / before.begin()->first / "result.json"), kept);

  const CommandOutcome other = batch({"--dof", "translation"});
  EXPECT_EQ(other.exit_status, 1);
  EXPECT_THAT(other.err, HasSubstr("holds a batch that was begun with other options: --preset=fast"));
}

TEST_F(BatchCommandTest, ItsPageSortsFiltersAndLinks) {
  if (!fs::exists("/usr/bin/chromedriver")) GTEST_SKIP() << "Chromium is not installed";
  ASSERT_EQ(batch().exit_status, 4);
  const CommandOutcome seen = run_shell(fmt::format("/usr/bin/python3 {}/tests/io/report/results_page_in_browser.py {}",
                                                    ISOSHIFT_SOURCE_DIR, (results() / "index.html").string()));
  EXPECT_EQ(seen.exit_status, 0) << seen.out;
}

TEST_F(BatchCommandTest, ShardsAndMergeGiveTheSame) {
  for (const char* shard : {"1/3", "2/3", "3/3"}) EXPECT_EQ(batch({"--shard", shard}).exit_status, 4);
  EXPECT_FALSE(fs::exists(results() / "summary.json"));
  EXPECT_EQ(batch({"--merge"}).exit_status, 4);
  EXPECT_EQ(summary()["cases"].size(), 4U);
  EXPECT_EQ(batch({"--shard", "4/3"}).exit_status, 2);
}

// Of one count shards work side by side; another count, or the same shard again, would work on the same cases.
TEST_F(BatchCommandTest, NoCaseIsWorkedOnTwice) {
  const BatchFolder folder(results(), {});
  const ShardLock first = folder.work_on({1, 4}, {}), second = folder.work_on({2, 4}, {});
  for (const Shard& other : {Shard{1, 4}, Shard{1, 8}, Shard{1, 1}})
    EXPECT_THROW(static_cast<void>(folder.work_on(other, {})), Error) << other.number << "/" << other.count;
  EXPECT_NO_THROW(static_cast<void>(folder.work_on({3, 4}, {})));
  EXPECT_NO_THROW(BatchFolder(results(), {}));
  EXPECT_THROW(BatchFolder(exported(), {}), Error);
}

TEST_F(BatchCommandTest, ATruncatedFileBesideMakesNoCase) {
  fs::resize_file(exported() / "1" / "RTIMAGE" / "KV_G090.dcm", 300);
  const CommandOutcome outcome = batch();
  EXPECT_THAT(outcome.err, HasSubstr("belong to no case: a file beside these X-rays may belong to them"));
  EXPECT_EQ(summary()["cases"].size(), 3U);
}

TEST_F(BatchCommandTest, PlanningDrrsBesideXraysMakeNoCase) {
  Notes before, notes;
  const std::vector<BatchCase> expected = scan_cases(exported(), false, before);
  const fs::path drr = exported() / "1" / "drr.dcm";
  fs::copy_file(expected.front().parts.images.front(), drr);
  edit(drr, [](DicomItem d) {
    d.put(DCM_SOPInstanceUID, "1.2.3");
    d.put(DCM_ImageType, "DERIVED\\SECONDARY\\DRR");
  });
  const std::vector<BatchCase> cases = scan_cases(exported(), false, notes);
  ASSERT_EQ(cases.size(), expected.size());
  for (std::size_t n = 0; n < cases.size(); ++n) EXPECT_EQ(cases[n].parts, expected[n].parts);
  EXPECT_THAT(notes.left_aside, testing::ElementsAre(HasSubstr("drr.dcm: ")));
  EXPECT_EQ(notes.warnings, before.warnings);
}

TEST_F(BatchCommandTest, OneBadCaseStopsNoOther) {
  edit(exported() / "1" / "RTIMAGE" / "F02" / "KV_G000.dcm", [](DicomItem d) { d.erase(DCM_GantryAngle); });
  const CommandOutcome outcome = batch();
  const nlohmann::json all = summary()["cases"];
  EXPECT_EQ(std::ranges::count_if(all, [](const auto& one) { return one["status"] == "failed"; }), 1);
  for (const auto& one : all) EXPECT_THAT(one.value("error", "GantryAngle"), HasSubstr("GantryAngle"));
  EXPECT_THAT(outcome.out, HasSubstr("1 failed"));
}

TEST_F(BatchCommandTest, AByteThatIsNoUtf8StopsNoOtherCase) {
  edit(exported() / "1" / "RTIMAGE" / "F02" / "KV_G000.dcm", [](DicomItem d) { d.put(DCM_GantryAngle, "9\xfc"); });
  EXPECT_THAT(batch().out, HasSubstr("1 failed"));
  const nlohmann::json all = summary()["cases"];
  EXPECT_EQ(std::ranges::count_if(all, [](const auto& one) { return one["status"] == "failed"; }), 1);
  EXPECT_GT(all.size(), 1U);
}

// A program that dies over its first case is started anew for the next.
TEST_F(BatchCommandTest, AWorkerThatDiesTakesItsCaseWithIt) {
  const fs::path program = folder_ / "dies";
  std::ofstream(program) << R"(#!/bin/sh
echo '{"ready":{}}'
read order
kill -9 $$
)";
  fs::permissions(program, fs::perms::owner_all);
  use_program(program);
  const CommandOutcome outcome = batch();
  EXPECT_EQ(outcome.exit_status, 4);
  const nlohmann::json all = summary()["cases"];
  EXPECT_EQ(all.size(), 4U);
  for (const auto& one : all) EXPECT_THAT(one["error"].get<std::string>(), HasSubstr("ended by signal 9"));

  std::ofstream(program) << R"(#!/bin/sh
echo '{"ready":{}}'
read order
echo hello
exec sleep 600
)";
  fs::remove_all(results());
  EXPECT_EQ(batch().exit_status, 4);
  const nlohmann::json all_again = summary()["cases"];
  for (const auto& one : all_again)
    EXPECT_THAT(one["error"].get<std::string>(), HasSubstr("the message of a worker: is not JSON"));

  std::ofstream(program) << "#!/bin/sh\nexit 3\n";
  fs::remove_all(results());
  EXPECT_THAT(batch().err, HasSubstr("a worker could not begin: the program ended with status 3"));
}

// No case is blamed for a full disk: with room again the same command goes on.
TEST_F(BatchCommandTest, AFullDiskLosesNoCase) {
  const fs::path disk = folder_ / "disk";
  fs::create_directories(disk);
  if (run_shell(fmt::format("mount -t tmpfs -o size=300k none {}", disk.string())).exit_status != 0)
    GTEST_SKIP() << "no file system can be mounted here";
  const auto on_disk = [&] {
    return run_command({"batch", exported().string(), "-o", (disk / "results").string(), "--preset", "fast"});
  };
  const CommandOutcome full = on_disk();
  EXPECT_EQ(full.exit_status, 1);
  EXPECT_THAT(full.err, HasSubstr("No space left on device"));
  EXPECT_EQ(run_shell("find " + disk.string() + " -name error.json").out, "");
  EXPECT_EQ(run_shell(fmt::format("mount -o remount,size=50m {}", disk.string())).exit_status, 0);
  const CommandOutcome again = on_disk();
  EXPECT_EQ(again.exit_status, 4) << again.err;
  EXPECT_EQ(std::distance(fs::directory_iterator(disk / "results" / "cases"), {}), 4);
  run_shell("umount " + disk.string());
}

TEST_F(BatchCommandTest, ScanWritesTheManifestThatBatchReads) {
  const fs::path manifest = folder_ / "cases.csv";
  EXPECT_EQ(run_command({"batch", "--scan", exported().string(), "-o", manifest.string()}).exit_status, 0);
  const std::vector<BatchCase> found = read_manifest(manifest);
  ASSERT_EQ(found.size(), 4U);
  EXPECT_EQ(found[0].parts.ct, std::vector{exported() / "1" / "CT"});
  EXPECT_EQ(found[0].parts.images.size(), 2U);
  EXPECT_EQ(found[1].parts.images[0], exported() / "1" / "RTIMAGE" / "F02" / "KV_G000.dcm");
  EXPECT_EQ(found[2].parts.plan, exported() / "2" / "RTPLAN.dcm");
  const fs::path plan = exported() / "2" / "RTPLAN.dcm";
  const std::string before = text_of_file(plan);
  for (const fs::path& there : {manifest, plan})
    EXPECT_EQ(run_command({"batch", "--scan", exported().string(), "-o", there.string()}).exit_status, 1);
  EXPECT_EQ(text_of_file(plan), before);
}

// X-rays that come late, or a file that is replaced, change what a case is: its earlier result does not stand for it.
TEST_F(BatchCommandTest, AResultOfOtherFilesIsSupersededAndNotLost) {
  fs::remove_all(exported() / "2");
  ASSERT_EQ(batch().exit_status, 4);
  const auto before = cases();
  ASSERT_EQ(before.size(), 2U);
  const fs::path images = exported() / "1" / "RTIMAGE", plan = exported() / "1" / "RTPLAN.dcm";
  const auto superseded = [&] {
    return fs::exists(results() / "superseded") ? std::distance(fs::directory_iterator(results() / "superseded"), {})
                                                : 0;
  };
  fs::copy_file(images / "KV_G000.dcm", images / "late.dcm");
  edit(images / "late.dcm", [](DicomItem d) {
    d.put(DCM_SOPInstanceUID, "2.25.7");
    d.put(DCM_RTImageLabel, "OBL");
  });
  EXPECT_THAT(batch().err, HasSubstr("its X-rays are grouped in another way now"));
  EXPECT_EQ(cases().size(), 2U);
  EXPECT_EQ(superseded(), 1);

  // Times and places of files do not matter, nor do files of others.
  for (const fs::path& file : {plan, images / "KV_G000.dcm"})
    fs::last_write_time(file, fs::last_write_time(file) + std::chrono::hours(1));
  fs::create_directories(exported() / "3");
  fs::copy_file(plan, exported() / "3" / "broken.dcm");
  fs::resize_file(exported() / "3" / "broken.dcm", 300);
  EXPECT_THAT(batch().err, HasSubstr("2 of 2 cases have been registered before"));
  EXPECT_EQ(superseded(), 1);

  edit(plan, [](DicomItem d) { d.put(DCM_RTPlanLabel, "OTHER"); });
  EXPECT_THAT(batch().err, HasSubstr("its files, its doubts, its anatomy or what the flags name have changed, so it"));
  EXPECT_EQ(superseded(), 3);

  // What is taken out of the folder keeps its result.
  fs::remove_all(images / "F02");
  batch();
  EXPECT_EQ(superseded(), 3);
  EXPECT_EQ(cases().size(), 2U);
}

// The same name, but another content.
TEST_F(BatchCommandTest, AChangedMachineProfileRegistersAgain) {
  fs::remove_all(exported() / "2");
  fs::remove_all(exported() / "1" / "RTIMAGE" / "F02");
  const fs::path machine = folder_ / "machine.json";
  const auto run_with = [&](const std::string& sigma) {
    nlohmann::json errors;
    for (const ImagerParameterInfo& info : imager_parameters())
      errors[std::string(info.key)] = {{"value", nullptr}, {"sigma", std::stod(sigma)}};
    replace_text(
        machine,
        nlohmann::json{{"machine_profile", 1}, {"name", "A"}, {"images", {{{"imager_errors", errors}}}}}.dump());
    return run_command({"batch", exported().string(), "-o", results().string(), "--preset", "fast", "--machine",
                        machine.string()})
        .err;
  };
  run_with("0.1");
  EXPECT_THAT(run_with("0.1"), HasSubstr("1 of 1 cases have been registered before"));
  EXPECT_THAT(run_with("0.2"), HasSubstr("or what the flags name have changed, so it is registered again"));
}

TEST_F(BatchCommandTest, AManifestIsOfTheXraysThatWereScanned) {
  fs::remove_all(exported() / "2");
  fs::remove_all(exported() / "1" / "RTIMAGE" / "F02");
  const fs::path manifest = folder_ / "cases.csv", image = exported() / "1" / "RTIMAGE" / "KV_G090.dcm";
  ASSERT_EQ(run_command({"batch", "--scan", exported().string(), "-o", manifest.string()}).exit_status, 0);
  edit(image, [](DicomItem d) { d.put(DCM_SOPInstanceUID, "2.25.7"); });
  run_command({"batch", manifest.string(), "-o", results().string(), "--preset", "fast"});
  ASSERT_EQ(summary()["cases"].size(), 1U);
  EXPECT_THAT(summary()["cases"][0]["error"].get<std::string>(), HasSubstr("are not those for which the manifest"));
  fs::remove(manifest);
  ASSERT_EQ(run_command({"batch", "--scan", exported().string(), "-o", manifest.string()}).exit_status, 0);
  run_command({"batch", manifest.string(), "-o", results().string(), "--preset", "fast"});
  EXPECT_EQ(summary()["cases"][0].value("error", ""), "");
}

// An X-ray is replaced by its retake while its case waits.
TEST_F(BatchCommandTest, ACaseIsOfTheXraysThatWereGrouped) {
  fs::remove_all(exported() / "2");
  fs::remove_all(exported() / "1" / "RTIMAGE" / "F02");
  struct Replaces : Observer {
    fs::path image;
    void progress(std::string_view step, double share) override {
      if (step.starts_with("Comparing") && share == 1.0)
        edit(image, [](DicomItem d) { d.put(DCM_SOPInstanceUID, "2.25.7"); });
    }
  } replaces;
  replaces.image = exported() / "1" / "RTIMAGE" / "KV_G090.dcm";
  const BatchOptions options{.cases = exported(), .output = results(), .kept = {"--preset=fast"}};
  Batch batch(options, replaces);
  EXPECT_TRUE(batch.run());
  ASSERT_EQ(batch.summary().cases.size(), 1U);
  EXPECT_THAT(batch.summary().cases[0].error, HasSubstr("its X-rays were changed while the batch ran"));
}

TEST_F(BatchCommandTest, ANameThatAManifestCannotHoldIsRefused) {
  fs::rename(exported() / "1", exported() / "1;2");
  const CommandOutcome outcome =
      run_command({"batch", "--scan", exported().string(), "-o", (folder_ / "cases.csv").string()});
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, HasSubstr("its name holds \";\""));
}

// AP and LAT, LAT again, the couch moves, AP and LAT: LAT again belongs to neither pair.
TEST_F(BatchCommandTest, ScanDoesNotPairARetakeAcrossACouchMove) {
  const fs::path images = exported() / "1" / "RTIMAGE";
  fs::remove_all(exported() / "2");
  fs::remove_all(images / "F02");
  const auto take = [&](const char* from, const char* name, const char* time) {
    fs::copy_file(images / from, images / name);
    edit(images / name, [&](DicomItem d) {
      d.put(DCM_SOPInstanceUID, fmt::format("1.2.{}", time + 1));
      d.put(DCM_AcquisitionTime, time);
    });
  };
  take("KV_G090.dcm", "c.dcm", "101600");
  take("KV_G000.dcm", "d.dcm", "102000");
  take("KV_G090.dcm", "e.dcm", "102010");
  const fs::path manifest = folder_ / "cases.csv";
  const CommandOutcome outcome = run_command({"batch", "--scan", exported().string(), "-o", manifest.string()});
  ASSERT_EQ(outcome.exit_status, 0) << outcome.err;
  EXPECT_THAT(outcome.err, HasSubstr("KV_G090 was taken again"));
  std::vector<std::vector<std::string>> found;
  for (const BatchCase& one : read_manifest(manifest)) {
    found.emplace_back();
    for (const fs::path& image : one.parts.images) found.back().push_back(image.stem());
  }
  using testing::ElementsAre;
  EXPECT_THAT(found, ElementsAre(ElementsAre("KV_G000", "KV_G090"), ElementsAre("c"), ElementsAre("d", "e")));
}

// A partner that may belong to either session is a doubt, which a manifest keeps: a batch that goes on reads the
// manifest.
TEST_F(BatchCommandTest, AManifestKeepsTheDoubtsOfTheScan) {
  const fs::path images = exported() / "1" / "RTIMAGE";
  fs::remove_all(exported() / "2");
  fs::remove_all(images / "F02");
  const auto take = [&](const char* name, const char* to, const char* time) {
    if (std::string_view(name) != to) fs::copy_file(images / name, images / to);
    edit(images / to, [&](DicomItem d) {
      d.put(DCM_SOPInstanceUID, fmt::format("1.2.{}", time + 1));
      d.put(DCM_AcquisitionTime, time);
      for (const TableReadOut& read_out : table_read_outs()) d.erase(read_out.tag);
    });
  };
  take("KV_G000.dcm", "KV_G000.dcm", "101600");
  take("KV_G090.dcm", "before.dcm", "101500");
  take("KV_G090.dcm", "KV_G090.dcm", "101630");
  const fs::path manifest = folder_ / "cases.csv";
  ASSERT_EQ(run_command({"batch", "--scan", exported().string(), "-o", manifest.string()}).exit_status, 0);
  std::vector<std::string> doubts;
  for (const BatchCase& one : read_manifest(manifest))
    if (one.parts.images.size() == 2) doubts = one.parts.doubts;
  EXPECT_THAT(doubts, testing::ElementsAre(HasSubstr("before.dcm, 60 s before, has no partner")));
}

class ManifestTest : public testing::Test {
 protected:
  std::string error_of(const std::string& text) const {
    std::ofstream(folder_ / "m.csv") << text;
    try {
      read_manifest(folder_ / "m.csv");
    } catch (const std::exception& error) {
      return error.what();
    }
    return "";
  }
  TemporaryFolder folder_;
};

TEST_F(ManifestTest, TablesAndJsonLinesSayTheSame) {
  std::ofstream(folder_ / "m.csv") << "case,ct,images,anatomy,doubts\n\"a\",\"CT, planning\",a.dcm;b.dcm,head,moved\n";
  std::ofstream(folder_ / "m.jsonl")
      << R"({"case": "a", "ct": "CT, planning", "images": ["a.dcm", "b.dcm"], "anatomy": "head", "doubts": ["moved"]})"
      << "\n";
  for (const char* name : {"m.csv", "m.jsonl"}) {
    const auto cases = read_manifest(folder_ / name);
    ASSERT_EQ(cases.size(), 1U);
    EXPECT_EQ(cases[0].parts.ct, std::vector{folder_ / "CT, planning"});
    EXPECT_EQ(cases[0].parts.images, (std::vector{folder_ / "a.dcm", folder_ / "b.dcm"}));
    EXPECT_EQ(cases[0].anatomy, "head");
    EXPECT_EQ(cases[0].parts.doubts, std::vector<std::string>{"moved"});
  }
}

TEST_F(BatchCommandTest, WhereNothingMakesACaseTheErrorSaysWhy) {
  for (const char* patient : {"1", "2"}) fs::remove_all(exported() / patient / "CT");
  const CommandOutcome outcome = batch();
  EXPECT_EQ(outcome.exit_status, 1);
  EXPECT_THAT(outcome.err, testing::AllOf(HasSubstr("holds no case"), HasSubstr("more X-rays belong to no case: ")));
}

TEST_F(ManifestTest, MistakesAreNamed) {
  EXPECT_THAT(error_of("case,foo\n"), HasSubstr("\"foo\" is not a column"));
  EXPECT_THAT(error_of("case,study\na,s\na,t\n"), HasSubstr("line 3: case a is there twice"));
  EXPECT_THAT(error_of("case,study\n../a,s\n"), HasSubstr("line 2: case \"../a\""));
  EXPECT_THAT(error_of("case,study\na\n"), HasSubstr("line 2: 1 cells, expected 2"));
  EXPECT_THAT(error_of("case,ct\na,CT\n"), HasSubstr("expected a study, or ct and images"));
  EXPECT_THAT(error_of("case,study\n"), HasSubstr("holds no case"));
  EXPECT_THAT(error_of("case,study,doubts,doubts\na,s,serious,\n"), HasSubstr("has the column doubts twice"));
  EXPECT_THAT(error_of("case,study\n\"a,s\n"), HasSubstr("line"));
  EXPECT_THAT(error_of("{\"case\": 3}\n"), HasSubstr("line 1: expected a JSON object"));
  EXPECT_THAT(error_of("{\"case\": \"a\", \"case\": \"b\"}\n"), HasSubstr("line 1: says case twice"));
}

}  // namespace
}  // namespace isoshift::batch_command_test
