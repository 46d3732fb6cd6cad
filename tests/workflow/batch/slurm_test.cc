// A batch on a cluster: a Slurm of the test's own.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "tests/support/small_study.h"

namespace isoshift::slurm_test {
namespace {

namespace fs = std::filesystem;

TEST(Slurm, RunsABatchAsAJobArray) {
  const TemporaryFolder work;
  PhantomOptions options = small_phantom();
  options.fractions = 3;
  fs::create_directories(work / "exported");
  write_phantom_study(options, work / "exported", {});
  const CommandOutcome outcome = run_shell(fmt::format(
      "{0}/tests/workflow/batch/slurm.sh {1} batch {2}/exported -o {2}/results --preset fast --slurm 2",
      ISOSHIFT_SOURCE_DIR, ISOSHIFT_PROGRAM, fs::path(work / ".").lexically_normal().parent_path().string()));
  constexpr int kNoSlurm = 77;
  if (outcome.exit_status == kNoSlurm) GTEST_SKIP() << "Slurm cannot be started here: " << outcome.out;
  EXPECT_EQ(outcome.exit_status, 0) << outcome.out;
  EXPECT_EQ(std::distance(fs::directory_iterator(work / "results" / "cases"), {}), 3);
  EXPECT_TRUE(fs::exists(work / "results" / "summary.json"));

  // As an undisturbed run.
  const CommandOutcome again =
      run_command({"batch", (work / "exported").string(), "-o", (work / "again").string(), "--preset", "fast"});
  EXPECT_EQ(again.exit_status, 4) << again.err;
  const auto table = [&](const char* folder) {
    std::ifstream file(work / folder / "summary.csv");
    std::string text;
    for (std::string line; std::getline(file, line);)
      text += line.substr(0, line.rfind(',', line.rfind(',') - 1)) + "\n";
    return text;  // without times and names of reports
  };
  EXPECT_EQ(table("results"), table("again"));
}

}  // namespace
}  // namespace isoshift::slurm_test
