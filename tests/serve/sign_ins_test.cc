#include "serve/sign_ins.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <thread>

namespace isoshift::sign_ins_test {
namespace {

using namespace std::chrono_literals;

class StillClock : public Clock {
 public:
  Time now() const override { return now_; }
  std::filesystem::file_time_type file_time() const override { return {}; }
  void wait(std::chrono::milliseconds length) override { now_ += length; }

 private:
  Time now_{1000h};
};

HttpRequest with_cookie(const std::string& cookie) {
  return {.method = "GET", .headers = {{"cookie", "other=1; isoshift=" + cookie}}};
}

class SignInsTest : public testing::Test {
 protected:
  std::string signed_in() { return sign_ins_.sign_in("doe", "right", "here").cookie.value_or(""); }

  ServeFile serve_{.pam_service = "isoshift", .roles = {{"doe", {Role::kView, Role::kRelease}}}};
  StillClock clock_;
  int asked_ = 0;
  SignIns sign_ins_{serve_, clock_, [this](const std::string&, const std::string& password) {
                      ++asked_;
                      return password == "right";
                    }};
};

TEST_F(SignInsTest, ThePasswordGivesACookieAndTheCookieOpens) {
  EXPECT_FALSE(sign_ins_.of({}));
  const std::string cookie = signed_in();
  ASSERT_EQ(cookie.size(), 64U);
  const auto who = sign_ins_.of(with_cookie(cookie));
  ASSERT_TRUE(who);
  EXPECT_EQ(who->user, "doe");
  EXPECT_TRUE(who->roles.contains(Role::kRelease));
  EXPECT_FALSE(sign_ins_.of(with_cookie(cookie.substr(1) + "0")));
  EXPECT_NE(who->token, cookie);
}

TEST_F(SignInsTest, ACookieThatSomebodyElseHasPlantedOpensNothing) {
  const std::string planted = signed_in();
  const std::string own = signed_in();
  EXPECT_NE(own, planted);
  sign_ins_.sign_out(with_cookie(planted));
  EXPECT_FALSE(sign_ins_.of(with_cookie(planted)));
  EXPECT_TRUE(sign_ins_.of(with_cookie(own)));
}

// The server has few threads, and a check of a password takes seconds.
TEST_F(SignInsTest, FewWaitForACheckAndOneOfAnAddress) {
  std::promise<void> may_end;
  const std::shared_future<void> ended = may_end.get_future().share();
  std::atomic<int> checked = 0;
  SignIns slow(serve_, clock_, [&](const std::string&, const std::string&) {
    ++checked;
    ended.wait();
    return true;
  });
  auto first = std::async(std::launch::async, [&] { return slow.sign_in("doe", "right", "here"); });
  while (checked == 0) std::this_thread::yield();
  EXPECT_TRUE(slow.sign_in("doe", "right", "here").must_wait);
  auto second = std::async(std::launch::async, [&] { return slow.sign_in("doe", "right", "there"); });
  std::this_thread::sleep_for(200ms);
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_TRUE(slow.sign_in("doe", "right", "elsewhere").must_wait);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 2s) << "at once";
  may_end.set_value();
  EXPECT_TRUE(first.get().cookie);
  EXPECT_TRUE(second.get().cookie);
  EXPECT_TRUE(slow.sign_in("doe", "right", "here").cookie);
}

TEST_F(SignInsTest, WhoHasNoRoleMayNotComeIn) {
  EXPECT_FALSE(sign_ins_.sign_in("root", "right", "here").cookie);
  EXPECT_EQ(asked_, 0) << "nobody can try passwords of other accounts";
}

TEST_F(SignInsTest, GuessersWait) {
  for (int n = 0; n < 5; ++n) EXPECT_FALSE(sign_ins_.sign_in("doe", "wrong", "there").must_wait);
  EXPECT_TRUE(sign_ins_.sign_in("doe", "right", "there").must_wait);
  EXPECT_EQ(asked_, 5);
  EXPECT_TRUE(sign_ins_.sign_in("doe", "right", "here").cookie) << "guessers elsewhere keep nobody out";
  clock_.wait(61s);
  EXPECT_TRUE(sign_ins_.sign_in("doe", "right", "there").cookie);
}

TEST_F(SignInsTest, TimeIsOverForThoseWhoLeft) {
  const std::string cookie = signed_in();
  clock_.wait(29min);
  EXPECT_TRUE(sign_ins_.of(with_cookie(cookie)));
  clock_.wait(29min);
  EXPECT_TRUE(sign_ins_.of(with_cookie(cookie), SignIns::Use::kStays));
  clock_.wait(2min);
  EXPECT_FALSE(sign_ins_.of(with_cookie(cookie))) << "an open page alone does not put off the end";
}

TEST_F(SignInsTest, NobodyStaysLongerThanADay) {
  const std::string cookie = signed_in();
  for (int n = 0; n < 24; ++n) {
    EXPECT_TRUE(sign_ins_.of(with_cookie(cookie)));
    clock_.wait(30min);
  }
  clock_.wait(1min);
  EXPECT_FALSE(sign_ins_.of(with_cookie(cookie)));
}

TEST(SignInsByProxy, OnlyTheProxyNamesUsers) {
  const ServeFile serve{.proxy = ServeFile::Proxy{.header = "x-remote-user", .secret = "word"},
                        .roles = {{"doe", {Role::kView}}}};
  const StillClock clock;
  SignIns sign_ins(serve, clock, [](const std::string&, const std::string&) { return true; });
  const auto of = [&](const std::string& user, const std::string& secret) {
    return sign_ins.of({.headers = {{"x-remote-user", user}, {"x-isoshift-proxy", secret}}});
  };
  ASSERT_TRUE(of("doe", "word"));
  EXPECT_EQ(of("doe", "word")->token, of("doe", "word")->token);
  EXPECT_FALSE(of("doe", "wore"));
  EXPECT_FALSE(of("doe", ""));
  EXPECT_FALSE(of("roe", "word"));
  EXPECT_FALSE(sign_ins.sign_in("doe", "x", "here").cookie);
}

}  // namespace
}  // namespace isoshift::sign_ins_test
