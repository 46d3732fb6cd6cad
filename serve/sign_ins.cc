#include "serve/sign_ins.h"

#include <fmt/format.h>
#include <openssl/crypto.h>

#include "base/random_word.h"
#include "base/sha256.h"

namespace isoshift {
namespace {

constexpr int kWrongPasswords = 5;  // in a row; then the user waits
constexpr std::chrono::minutes kWait(1);
constexpr std::chrono::seconds kPatience(5);
constexpr std::size_t kMostSigningIn = 2;
constexpr std::size_t kMostOpen = 1000, kMostFailures = 10000;

bool is_same(const std::string& a, const std::string& b) {  // takes as long for any two words of one length
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace

std::string sign_in_cookie_header(const HttpRequest& request, const std::string& value) {
  return fmt::format("{}={}; Path=/; HttpOnly; SameSite=Strict{}{}", sign_in_cookie(request), value,
                     value.empty() ? "; Max-Age=0" : "", request.is_encrypted ? "; Secure" : "");
}

SignIns::SignIns(const ServeFile& serve, const Clock& clock, IsPassword is_password, const Limits& limits)
    : serve_(serve), clock_(clock), is_password_(std::move(is_password)), limits_(limits) {}

bool SignIns::is_over(const Open& open) const {
  const Clock::Time now = clock_.now();
  return now - open.last > limits_.idle || now - open.since > limits_.longest;
}

std::optional<SignedIn> SignIns::by_proxy(const HttpRequest& request) {
  if (!is_same(request.header("x-isoshift-proxy"), serve_.proxy->secret)) return std::nullopt;
  const std::string user = request.header(serve_.proxy->header);
  const auto roles = serve_.roles.find(user);
  if (roles == serve_.roles.end()) return std::nullopt;
  const std::lock_guard lock(mutex_);
  std::string& token = tokens_[user];
  if (token.empty()) token = random_word();
  return SignedIn{.user = user, .roles = roles->second, .token = token};
}

std::optional<SignedIn> SignIns::of(const HttpRequest& request, Use use) {
  if (serve_.proxy) return by_proxy(request);
  const std::string cookie = request.cookie(sign_in_cookie(request));
  if (cookie.empty()) return std::nullopt;
  const std::lock_guard lock(mutex_);
  const auto found = open_.find(sha256_of(cookie));
  if (found == open_.end()) return std::nullopt;
  if (is_over(found->second)) {
    open_.erase(found);
    return std::nullopt;
  }
  if (use == Use::kActs) found->second.last = clock_.now();
  return found->second.who;
}

// Few wait at a time, each from another address: the server has few threads, which others need.
class SignIns::Turn {
 public:
  Turn(SignIns& sign_ins, const std::string& from) : sign_ins_(sign_ins), from_(from) {
    const std::lock_guard lock(sign_ins_.mutex_);
    is_mine_ = sign_ins_.signing_in_.size() < kMostSigningIn && sign_ins_.signing_in_.insert(from_).second;
  }
  ~Turn() {
    if (!is_mine_) return;
    const std::lock_guard lock(sign_ins_.mutex_);
    sign_ins_.signing_in_.erase(from_);
  }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;
  bool is_mine() const { return is_mine_; }

 private:
  SignIns& sign_ins_;
  std::string from_;
  bool is_mine_ = false;
};

// Users without a role are not looked up: nobody can try passwords of other accounts of this computer here.
SignIns::Attempt SignIns::sign_in(const std::string& user, const std::string& password, const std::string& from) {
  const auto roles = serve_.roles.find(user);
  if (serve_.proxy || roles == serve_.roles.end()) return {};
  const Turn turn(*this, from);
  if (!turn.is_mine()) return {.must_wait = true};
  const std::unique_lock one_at_a_time(checking_, kPatience);  // PAM may take seconds
  if (!one_at_a_time) return {.must_wait = true};
  const Clock::Time now = clock_.now();
  const std::string guesser = user + " " + from;
  {
    const std::lock_guard lock(mutex_);
    std::erase_if(failures_, [&](const auto& one) { return now - one.second.last > kWait; });
    const auto failed = failures_.find(guesser);
    if (failures_.size() >= kMostFailures || (failed != failures_.end() && failed->second.count >= kWrongPasswords))
      return {.must_wait = true};
  }
  const bool is_right = is_password_(user, password);
  const std::lock_guard lock(mutex_);
  if (!is_right) {
    Failures& failures = failures_[guesser];
    ++failures.count;
    failures.last = now;
    return {};
  }
  failures_.erase(guesser);
  std::erase_if(open_, [&](const auto& one) { return is_over(one.second); });
  if (open_.size() >= kMostOpen) return {.must_wait = true};
  const std::string cookie = random_word();
  open_[sha256_of(cookie)] = {
      .who = {.user = user, .roles = roles->second, .token = random_word()}, .since = now, .last = now};
  return {.cookie = cookie};
}

void SignIns::sign_out(const HttpRequest& request) {
  const std::lock_guard lock(mutex_);
  open_.erase(sha256_of(request.cookie(sign_in_cookie(request))));
}

}  // namespace isoshift
