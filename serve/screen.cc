#include "serve/screen.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "io/report/report_page.h"
#include "serve/pages/icon.svg.h"
#include "serve/pages/room.css.h"
#include "serve/pages/room.html.h"
#include "serve/pages/room.js.h"
#include "serve/pages/session.html.h"
#include "serve/pages/session.js.h"
#include "serve/pages/shared.js.h"
#include "serve/pages/sign_in.html.h"
#include "serve/pages/sign_in.js.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

struct Page {
  std::string_view path, type;
  const char* text;
  bool is_for_all = false;  // also for those who are not signed in
};
constexpr std::string_view kHtml = "text/html; charset=utf-8", kScript = "text/javascript; charset=utf-8";
constexpr std::array kPages = {Page{"/", kHtml, kRoomHtml},
                               Page{"/room.js", kScript, kRoomJs},
                               Page{"/session.js", kScript, kSessionJs},
                               Page{"/shared.js", kScript, kSharedJs, true},
                               Page{"/sign-in", kHtml, kSignInHtml, true},
                               Page{"/sign_in.js", kScript, kSignInJs, true},
                               Page{"/icon.svg", "image/svg+xml", kIconSvg, true},
                               Page{"/room.css", "text/css; charset=utf-8", kRoomCss, true}};
constexpr std::string_view kSessionPage = "/session/", kApi = "/api/", kSessionApi = "/api/sessions/";

HttpResponse json(const Json& json, int status = 200) {
  return {.status = status, .body = json.dump(-1, ' ', false, Json::error_handler_t::replace)};
}
HttpResponse refusal(int status, const std::string& why) { return json({{"error", why}}, status); }

HttpResponse see_other(const std::string& place) { return {.status = 303, .headers = {{"Location", place}}}; }

bool has_type_json(const HttpRequest& request) {
  return request.header("content-type").starts_with("application/json");
}

// A session's report brings its own script and styles, and pictures as data. It runs in a frame of the session's page,
// apart from everything else here.
HttpResponse report(std::string html) {
  return {.type = std::string(kHtml),
          .body = std::move(html),
          .headers = {{"Content-Security-Policy",
                       "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
                       "frame-ancestors 'self'; sandbox allow-scripts"},
                      {"X-Frame-Options", "SAMEORIGIN"}}};
}

}  // namespace

HttpResponse Screen::answer(const HttpRequest& request) {
  const bool is_read = request.method == "GET";
  if (!is_read && request.method != "POST") return refusal(405, "GET or POST is expected");
  const auto who = sign_ins_.of(request);
  if (is_read) {
    const auto* page = std::ranges::find(kPages, request.path, &Page::path);
    if (page != kPages.end() && (who || page->is_for_all)) return {.type = std::string(page->type), .body = page->text};
    if (who && request.path.starts_with(kSessionPage)) return {.type = std::string(kHtml), .body = kSessionHtml};
  }
  if (!is_read && request.path == "/api/sign-in") return sign_in(request);
  if (!who) {
    if (!is_read || request.path.starts_with(kApi)) return refusal(401, "Nobody is signed in.");
    return by_proxy_ ? refusal(403, "The proxy names no user who may see this.") : see_other("/sign-in");
  }
  if (!is_read && request.header(kTokenHeader) != who->token)
    return refusal(403, "The request does not come from a page of this program.");
  try {
    if (!is_read && request.path == "/api/sign-out") return sign_out(request);
    if (request.path.starts_with(kApi)) return api(request, *who);
  } catch (const NotThere& error) {
    return refusal(404, error.what());
  } catch (const Error& error) {
    return refusal(409, error.what());
  }
  return refusal(404, "There is nothing at this address.");
}

HttpResponse Screen::sign_in(const HttpRequest& request) {
  // A form of another site can send no JSON without this program's consent.
  if (!has_type_json(request)) return refusal(415, "JSON is expected.");
  std::string user, password;
  try {
    const Json body = Json::parse(request.body);
    user = body.at("user");
    password = body.at("password");
  } catch (const Json::exception&) {
    return refusal(400, "user and password are expected.");
  }
  const SignIns::Attempt attempt = sign_ins_.sign_in(user, password);
  if (attempt.must_wait) return refusal(429, "Too many attempts. Wait a minute.");
  if (!attempt.cookie) {
    room_.audit("sign-in refused", user.substr(0, 64));
    return refusal(403, "Name or password is wrong, or this user has no role here.");
  }
  room_.audit("signed in", user);
  HttpResponse response = json({{"user", user}});
  response.headers.emplace_back("Set-Cookie", fmt::format("{}={}; Path=/; HttpOnly; SameSite=Strict{}", kSignInCookie,
                                                          *attempt.cookie, request.is_encrypted ? "; Secure" : ""));
  return response;
}

HttpResponse Screen::sign_out(const HttpRequest& request) {
  sign_ins_.sign_out(request);
  HttpResponse response = json(Json::object());
  response.headers.emplace_back("Set-Cookie", fmt::format("{}=; Path=/; HttpOnly; Max-Age=0", kSignInCookie));
  return response;
}

HttpResponse Screen::api(const HttpRequest& request, const SignedIn& who) {
  if (request.method == "GET" && request.path == "/api/me") {
    Json roles = Json::array();
    for (const Role role : who.roles) roles.push_back(to_string(role));
    return json({{"user", who.user}, {"roles", roles}, {"token", who.token}, {"can_sign_out", !by_proxy_}});
  }
  if (request.method == "GET" && request.path == "/api/room") {
    const auto seen = room_.seen();
    Json list = seen->list;
    list["version"] = seen->version;
    return json(list);
  }
  if (request.method == "GET" && request.path == "/api/events") return events(request);
  if (request.path.starts_with(kSessionApi)) {
    const std::string rest = request.path.substr(kSessionApi.size());
    const std::size_t end = std::min(rest.find('/'), rest.size());
    return session(request, who, rest.substr(0, end), rest.substr(std::min(end + 1, rest.size())));
  }
  return refusal(404, "There is nothing at this address.");
}

HttpResponse Screen::session(const HttpRequest& request, const SignedIn& who, const std::string& name,
                             const std::string& what) {
  if (request.method == "POST") {
    if (what == "release") return release(request, who, name);
    return refusal(404, "There is nothing at this address.");
  }
  if (what.empty()) return json(room_.session(name));
  if (what == "report.html") {
    HttpResponse response = report(room_.file(name, "report.html"));
    room_.audit("viewed", who.user, name);
    return response;
  }
  if (what == "report.pdf") return {.type = "application/pdf", .body = room_.file(name, "report.pdf")};
  return refusal(404, "There is nothing at this address.");
}

HttpResponse Screen::release(const HttpRequest& request, const SignedIn& who, const std::string& name) {
  if (!who.roles.contains(Role::kRelease)) return refusal(403, fmt::format("{} may not release.", who.user));
  if (!has_type_json(request)) return refusal(415, "JSON is expected.");
  std::string record;
  bool despite = false;
  try {
    const Json body = Json::parse(request.body);
    record = body.at("record");
    despite = body.at("despite");
  } catch (const Json::exception&) {
    return refusal(400, "record and despite are expected.");
  }
  room_.release(name, record, who.user, despite);
  return json(room_.session(name));
}

// A sign of life every few seconds, and the version of the list. The stream ends when the user's time is over.
HttpResponse Screen::events(const HttpRequest& request) {
  return {.body = "", .events = [this, request]() -> std::optional<std::string> {
            if (!sign_ins_.of(request, SignIns::Use::kStays)) return std::nullopt;
            const auto seen = room_.seen();
            return Json{{"version", seen->version}, {"engine", seen->does_engine_run ? "runs" : "stopped"}}.dump();
          }};
}

}  // namespace isoshift
