#pragma once
// The room's screen: answers what browsers ask for. Pages are static files; what they show comes as JSON.

#include <optional>
#include <string>

#include "io/config/serve_file.h"
#include "serve/desk.h"
#include "serve/http_message.h"
#include "serve/room.h"
#include "serve/sign_ins.h"

namespace isoshift {

class Screen {
 public:
  Screen(Room& room, Desk& desk, SignIns& sign_ins, const Clock& clock, bool by_proxy)
      : room_(room), desk_(desk), sign_ins_(sign_ins), clock_(clock), by_proxy_(by_proxy) {}

  // May be called from several threads.
  HttpResponse answer(const HttpRequest& request);

 private:
  std::optional<HttpResponse> page(const std::string& path, bool is_signed_in) const;
  HttpResponse sign_in(const HttpRequest& request);
  HttpResponse sign_out(const HttpRequest& request);
  HttpResponse api(const HttpRequest& request, const SignedIn& who);
  HttpResponse session(const HttpRequest& request, const SignedIn& who, const std::string& name,
                       const std::string& what);
  HttpResponse choose(const HttpRequest& request, const SignedIn& who, const std::string& name);
  HttpResponse withdraw_choice(const HttpRequest& request, const SignedIn& who, const std::string& name);
  HttpResponse decide(const HttpRequest& request, const SignedIn& who, const std::string& name);
  HttpResponse release(const HttpRequest& request, const SignedIn& who, const std::string& name);
  HttpResponse events(const HttpRequest& request);

  Room& room_;
  Desk& desk_;
  SignIns& sign_ins_;
  const Clock& clock_;
  bool by_proxy_;
};

}  // namespace isoshift
