#include "base/pattern.h"

#include <gtest/gtest.h>

namespace isoshift::pattern_test {
namespace {

TEST(Pattern, MatchesTheWholeText) {
  const Pattern month("[0-9]{4}-[0-9]{2}");
  EXPECT_TRUE(month.matches("2026-11"));
  EXPECT_FALSE(month.matches("2026-11-30"));
  EXPECT_FALSE(month.matches(std::string("2026-11\0", 8)));
}

TEST(Pattern, TakesLettersAsWrittenUnlessAnyCaseWill) {
  EXPECT_FALSE(Pattern("skull").matches("Skull"));
  EXPECT_TRUE(Pattern("skull", Pattern::Case::kAny).matches("Skull"));
}

TEST(Pattern, IsRemovedWhereverItIs) {
  EXPECT_EQ(Pattern("[.]partial-[A-Za-z0-9]+").removed_from("a.partial-Xy1/b and c.partial-2"), "a/b and c");
}

}  // namespace
}  // namespace isoshift::pattern_test
