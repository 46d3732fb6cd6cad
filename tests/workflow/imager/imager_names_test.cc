#include "workflow/imager/imager_names.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isoshift::imager_names_test {
namespace {

TEST(ImagerNames, OfOneMachineAreItsBeams) {
  ImagerNames names;
  EXPECT_EQ(names.number_of(true, "LINAC1"), 0U);
  EXPECT_EQ(names.number_of(false, "LINAC1"), 1U);
  EXPECT_EQ(names.number_of(true, "LINAC1"), 0U);
  EXPECT_THAT(names.names(), testing::ElementsAre("MV", "kV"));
}

// A machine without a name may be any of the others, or none.
TEST(ImagerNames, OfSeveralMachinesNameThem) {
  ImagerNames names;
  names.number_of(false, "LINAC1");
  names.number_of(false, "LINAC2");
  names.number_of(false, "");
  EXPECT_THAT(names.names(), testing::ElementsAre("kV of LINAC1", "kV of LINAC2", "kV of a machine without a name"));
}

}  // namespace
}  // namespace isoshift::imager_names_test
