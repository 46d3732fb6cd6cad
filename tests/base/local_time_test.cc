#include "base/local_time.h"

#include <gtest/gtest.h>

namespace isoshift::local_time_test {
namespace {

// 1772352962 s: 2026-03-01 08:16:02 UTC (date -u -d @1772352962).
TEST(LocalTime, IsComparedInUtc) {
  EXPECT_EQ(utc_seconds_at("2026-03-01T08:16:02+0000"), 1772352962.0);
  EXPECT_EQ(utc_seconds_at("2026-03-01T09:16:02+0100"), 1772352962.0);
  EXPECT_EQ(utc_seconds_at("2026-02-28T22:46:02-0930"), 1772352962.0);
  EXPECT_TRUE(utc_seconds_at(local_time()));
  for (const char* none : {"", "2026-03-01", "2026-03-01T08:16:02", "2026-03-01T08:16:02 UTC",
                           "2026-03-01T08:16:02+01:00", "2026-03-01T08:16:02+010", "2026-03-01T08:16:02x+0100"})
    EXPECT_FALSE(utc_seconds_at(none)) << none;
}

}  // namespace
}  // namespace isoshift::local_time_test
