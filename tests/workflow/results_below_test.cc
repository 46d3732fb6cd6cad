#include "workflow/results_below.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/output_folder.h"
#include "io/report/result_folder.h"
#include "tests/support/oblique_report.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::results_below_test {
namespace {

using testing::ElementsAre;

// A case that failed on one day, and a result of the same name on another.
TEST(ResultsBelow, ResultsAndFailedCasesHaveNamesOfTheirOwn) {
  const TemporaryFolder folder;
  for (const char* result : {"monday/s1", "tuesday/s2"}) {
    std::filesystem::create_directories(folder / result);
    write_result(oblique_report(Verdict::kAccepted), folder / result);
  }
  std::filesystem::create_directories(folder / "tuesday/s1");
  write_text(folder / "tuesday/s1/error.json", R"({"error": "no CT"})");
  const ResultsBelow found = results_below(folder.path());
  ASSERT_EQ(found.failed.size(), 1U);
  EXPECT_EQ(found.failed.front().name, "tuesday/s1");
  EXPECT_EQ(found.failed.front().message, "no CT");
  std::vector<std::string> names;
  for (const NamedResult& one : found.results) names.push_back(one.name);
  EXPECT_THAT(names, ElementsAre("monday/s1", "s2"));
}

}  // namespace
}  // namespace isoshift::results_below_test
