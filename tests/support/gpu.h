#pragma once
// Tests that need a GPU: they are skipped where there is none, but fail where ISOSHIFT_REQUIRE_GPU says that there is
// one.

#include <gtest/gtest.h>

#include <cstdlib>

#include "drr/gl/context.h"

// For the body of a test or SetUp().
#define ISOSHIFT_SKIP_WITHOUT_GPU()                                        \
  do {                                                                     \
    if (const auto none = isoshift::why_no_gpu()) {                        \
      if (std::getenv("ISOSHIFT_REQUIRE_GPU") != nullptr) FAIL() << *none; \
      GTEST_SKIP() << "no GPU here";                                       \
    }                                                                      \
  } while (false)
