// Who releases a result: a user may set SUDO_USER to any name, but not the user whom the kernel saw logging in.

#include "base/system_user.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>

namespace isoshift::system_user_test {
namespace {

constexpr int kKernelRefuses = 2;

// In a process of its own, for which `id` has logged in: ends with 0 if system_user() names `expected`.
[[noreturn]] void log_in_as(uid_t id, const std::string& expected) {
  ::setenv("SUDO_USER", "somebody-else", 1);
  std::ofstream login("/proc/self/loginuid");
  login << id << std::flush;
  if (!login) std::_Exit(kKernelRefuses);
  std::_Exit(system_user().sudo_user == expected ? 0 : 1);
}

TEST(SystemUserTest, TheKernelSaysWhoLoggedIn) {
  bool is_refused = false;
  const auto is_named = [&](int status) {
    is_refused = testing::ExitedWithCode(kKernelRefuses)(status);
    return is_refused || testing::ExitedWithCode(0)(status);
  };
  EXPECT_EXIT(log_in_as(60123, "60123"), is_named, "");
  EXPECT_EXIT(log_in_as(::geteuid(), ""), is_named, "");
  if (is_refused) GTEST_SKIP() << "the kernel lets nobody log in here; needs root";
}

TEST(SystemUserTest, SudoSaysWhoItWasWhereTheKernelDoesNot) {
  unsigned login = 0;
  std::ifstream("/proc/self/loginuid") >> login;
  if (login != ~0U) GTEST_SKIP() << "somebody logged in";
  ::setenv("SUDO_USER", "jdoe", 1);
  EXPECT_EQ(system_user().sudo_user, "jdoe");
  ::unsetenv("SUDO_USER");
  EXPECT_EQ(system_user().sudo_user, "");
}

}  // namespace
}  // namespace isoshift::system_user_test
