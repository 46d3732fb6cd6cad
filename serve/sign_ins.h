#pragma once
// Who is signed in: by a cookie that this program gave for a password, or by the header of a proxy that signs users in.

#include <chrono>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <set>
#include <string>

#include "io/config/serve_file.h"
#include "serve/http_message.h"
#include "workflow/room/clock.h"

namespace isoshift {

struct SignedIn {
  std::string user;
  std::set<Role> roles;
  // Every request that changes something must carry it in the header X-Isoshift-Token: pages of other sites can send
  // the cookie, and cannot know this.
  std::string token;
};

// The cookie's name. With TLS one that no other host can plant.
inline const char* sign_in_cookie(const HttpRequest& request) {
  return request.is_encrypted ? "__Host-isoshift" : "isoshift";
}
// The header Set-Cookie that gives it a value; without one: that takes it away.
std::string sign_in_cookie_header(const HttpRequest& request, const std::string& value);
inline constexpr const char* kTokenHeader = "x-isoshift-token";

// May be called from several threads.
class SignIns {
 public:
  using IsPassword = std::function<bool(const std::string& user, const std::string& password)>;

  // How long who does nothing, and who does something, stays signed in.
  struct Limits {
    std::chrono::minutes idle{30}, longest{12 * 60};
  };
  // `is_password` asks PAM.
  SignIns(const ServeFile& serve, const Clock& clock, IsPassword is_password)
      : SignIns(serve, clock, std::move(is_password), Limits()) {}
  SignIns(const ServeFile& serve, const Clock& clock, IsPassword is_password, const Limits& limits);

  // Nobody for a request of somebody who is not signed in, or has no role. kStays: an open page asks by itself, and its
  // user may have left: that does not put off the end.
  enum class Use { kActs, kStays };
  std::optional<SignedIn> of(const HttpRequest& request, Use use = Use::kActs);

  struct Attempt {
    std::optional<std::string> cookie;  // the value; unset: not signed in
    bool must_wait = false;             // too many wrong passwords, or others are being checked
  };
  // A user who signs in anew has a new cookie, so that one that somebody else has planted is worth nothing.
  // `from`: an address, from which one user signs in at a time. Wrong passwords from elsewhere keep nobody out.
  Attempt sign_in(const std::string& user, const std::string& password, const std::string& from);
  void sign_out(const HttpRequest& request);

 private:
  struct Open {
    SignedIn who;
    Clock::Time since, last;
  };
  struct Failures {
    int count = 0;
    Clock::Time last;
  };
  class Turn;
  bool is_over(const Open& open) const;
  std::optional<SignedIn> by_proxy(const HttpRequest& request);

  const ServeFile& serve_;
  const Clock& clock_;
  IsPassword is_password_;
  Limits limits_;
  std::mutex mutex_;
  std::timed_mutex checking_;
  std::set<std::string> signing_in_;           // addresses
  std::map<std::string, Open> open_;           // by the SHA-256 of the cookie: what is kept here opens nothing
  std::map<std::string, std::string> tokens_;  // by user, of those whom the proxy names
  std::map<std::string, Failures> failures_;   // by user and address
};

}  // namespace isoshift
