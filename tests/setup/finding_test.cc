#include "setup/finding.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace isoshift::finding_test {
namespace {

constexpr int kChecks = static_cast<int>(Check::kSurrogate) + 1;

TEST(Finding, EveryCheckHasANameOfItsOwnAndWords) {
  std::set<std::string> names, sentences;
  for (int n = 0; n < kChecks; ++n) {
    const auto check = static_cast<Check>(n);
    EXPECT_EQ(check_from(to_string(check)), check) << n;
    names.emplace(to_string(check));
    const std::string sentence = in_words({.check = check, .words = "what " + std::string(to_string(check)) + " says"});
    EXPECT_GE(sentence.size(), 7U) << to_string(check);
    sentences.insert(sentence);
  }
  EXPECT_EQ(names.size(), kChecks);
  EXPECT_EQ(sentences.size(), kChecks);
  EXPECT_FALSE(check_from("luck"));
}

TEST(Finding, TheWorstConsequenceIsTheVerdict) {
  EXPECT_EQ(verdict_of({}), Verdict::kAccepted);
  const std::vector<Finding> findings = {{.check = Check::kMatch, .consequence = Verdict::kRejected},
                                         {.check = Check::kUnobservable}};
  EXPECT_EQ(verdict_of(findings), Verdict::kRejected);
  EXPECT_EQ(verdict_of(std::span(findings).subspan(1)), Verdict::kReview);
}

TEST(Finding, SaysWhatWasMeasuredAndExpected) {
  EXPECT_EQ(in_words({.check = Check::kTargetAtEdgeOfField,
                      .view = "KV_G090",
                      .measures = {{.value = 8.2, .limit = 12.0, .unit = "mm"}}}),
            "KV_G090 shows the target 8 mm from the edge of the field: what surrounds it is not seen (12 mm are "
            "expected)");
  EXPECT_EQ(in_words({.check = Check::kUncertainAxis,
                      .subject = "rotation about x",
                      .measures = {{.value = 1.25, .limit = 1.0, .unit = "deg"}}}),
            "the rotation about x is uncertain: 1.2 degrees at two sigma");
}

}  // namespace
}  // namespace isoshift::finding_test
