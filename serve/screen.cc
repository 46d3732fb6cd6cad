#include "serve/screen.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "serve/answers.h"
#include "serve/pages.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kAutomaticHeader = "x-isoshift-automatic";  // a page asks by itself
constexpr std::chrono::seconds kBeat(4);
constexpr std::size_t kLongestReason = 1000;
constexpr std::string_view kSessionPage = "/session/", kByHand = "/by-hand", kTrend = "/trend", kChoose = "/choose",
                           kApi = "/api/", kSessionApi = "/api/sessions/", kManual = "manual/", kEvents = "/api/events";
// What the page on which people sign in is made of.
constexpr std::array kForAll = {"/shared.js", "/sign_in.js", "/icon.svg", "/room.css"};

// Of a user of the system or of the proxy: whatever else arrives is not looked up, counted or logged.
bool is_name(const std::string& user) {
  constexpr std::size_t kLongest = 64;
  return !user.empty() && user.size() <= kLongest &&
         std::ranges::all_of(user, [](unsigned char c) { return c > ' ' && c < 127; });
}

std::optional<HttpResponse> refusal_of_reason(const std::string& reason, bool may_be_empty = false) {
  if (reason.size() > kLongestReason) return refusal(400, "The reason is too long.");
  if (!may_be_empty && reason.find_first_not_of(" \t\r\n") == std::string::npos)
    return refusal(400, "A reason is missing.");
  return std::nullopt;
}

}  // namespace

HttpResponse Screen::answer(const HttpRequest& request) {
  const bool is_read = request.method == "GET";
  if (!is_read && request.method != "POST") return refusal(405, "GET or POST is expected");
  // What a page asks for by itself does not tell that its user is still there.
  const bool is_automatic = request.path == kEvents || !request.header(kAutomaticHeader).empty();
  auto who = sign_ins_.of(request, is_automatic ? SignIns::Use::kStays : SignIns::Use::kActs);
  if (who && !who->roles.contains(Role::kView)) who.reset();
  if (is_read)
    if (auto found = page(request.path, who.has_value())) return *std::move(found);
  if (!is_read && request.path == "/api/sign-in" && !by_proxy_) return sign_in(request);
  if (!who) {
    if (by_proxy_) return refusal(403, "The proxy names no user who may see this.");
    return !is_read || request.path.starts_with(kApi) ? refusal(401, "Nobody is signed in.") : see_other("/sign-in");
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

// Pages and what they are made of; nothing where there is none, or who asks may not see it.
std::optional<HttpResponse> Screen::page(const std::string& path, bool is_signed_in) const {
  if (path == "/sign-in" && !by_proxy_) return page_answer(Page::kSignIn);
  if (!is_signed_in) {
    const bool is_for_all = !by_proxy_ && std::ranges::find(kForAll, path) != kForAll.end();
    return is_for_all ? static_answer(path) : std::nullopt;
  }
  if (path == "/") return page_answer(Page::kSessions);
  if (path.starts_with(kSessionPage))
    return page_answer(path.ends_with(kByHand)   ? Page::kManual
                       : path.ends_with(kTrend)  ? Page::kTrend
                       : path.ends_with(kChoose) ? Page::kChoose
                                                 : Page::kSession);
  return static_answer(path);
}

HttpResponse Screen::sign_in(const HttpRequest& request) {
  if (!has_type_json(request)) return refusal(415, "JSON is expected.");
  std::string user, password;
  try {
    const Json body = Json::parse(request.body);
    user = body.at("user");
    password = body.at("password");
  } catch (const Json::exception&) {
    return refusal(400, "user and password are expected.");
  }
  if (!is_name(user)) return refusal(400, "This is no name of a user.");
  const SignIns::Attempt attempt = sign_ins_.sign_in(user, password, request.from);
  if (attempt.must_wait)
    return refusal(429, "There were too many wrong passwords, or others are signing in. Try again in a minute.");
  if (!attempt.cookie) {
    room_.audit("sign-in refused", user);
    return refusal(403, "Name or password is wrong, or this user has no role here.");
  }
  room_.audit("signed in", user);
  HttpResponse response = json_answer({{"user", user}});
  response.headers.emplace_back("Set-Cookie", sign_in_cookie_header(request, *attempt.cookie));
  return response;
}

HttpResponse Screen::sign_out(const HttpRequest& request) {
  sign_ins_.sign_out(request);
  HttpResponse response = json_answer(Json::object());
  response.headers.emplace_back("Set-Cookie", sign_in_cookie_header(request, ""));
  return response;
}

HttpResponse Screen::api(const HttpRequest& request, const SignedIn& who) {
  if (request.method == "GET" && request.path == "/api/me") {
    Json roles = Json::array();
    for (const Role role : who.roles) roles.push_back(to_string(role));
    return json_answer({{"user", who.user}, {"roles", roles}, {"token", who.token}, {"can_sign_out", !by_proxy_}});
  }
  if (request.method == "GET" && request.path == "/api/room") {
    const auto seen = room_.seen();
    Json list = seen->list;
    list["version"] = seen->version;
    return json_answer(list);
  }
  if (request.method == "GET" && request.path == kEvents) return events(request);
  if (request.path.starts_with(kSessionApi)) {
    const std::string rest = request.path.substr(kSessionApi.size());
    const std::size_t end = std::min(rest.find('/'), rest.size());
    return session(request, who, rest.substr(0, end), rest.substr(std::min(end + 1, rest.size())));
  }
  return refusal(404, "There is nothing at this address.");
}

HttpResponse Screen::session(const HttpRequest& request, const SignedIn& who, const std::string& name,
                             const std::string& what) {
  if (what.starts_with(kManual)) return desk_.answer(request, who, name, what.substr(kManual.size()));
  if (request.method == "POST") {
    if (what == "choose") return choose(request, who, name);
    if (what == "withdraw-choice") return withdraw_choice(request, who, name);
    if (what == "decide") return decide(request, who, name);
    if (what == "release") return release(request, who, name);
    return refusal(404, "There is nothing at this address.");
  }
  if (what.empty()) return json_answer(room_.session(name));
  if (what == "options") return json_answer(room_.options(name));
  if (what == "trend") {
    Json trend = room_.trend(name);
    if (request.header(kAutomaticHeader).empty()) room_.audit("viewed", who.user, name);
    return json_answer(trend);
  }
  if (what != "report.html" && what != "report.pdf") return refusal(404, "There is nothing at this address.");
  std::string content = room_.file(name, what);
  room_.audit("viewed", who.user, name);
  if (what == "report.html") return report_answer(std::move(content));
  return {.type = "application/pdf", .body = std::move(content)};
}

HttpResponse Screen::choose(const HttpRequest& request, const SignedIn& who, const std::string& name) {
  if (!who.roles.contains(Role::kRegister)) return refusal(403, fmt::format("{} may not choose.", who.user));
  if (!has_type_json(request)) return refusal(415, "JSON is expected.");
  ChosenIds ids;
  std::string reason;
  try {
    const Json body = Json::parse(request.body);
    ids = {.xrays = body.at("xrays"), .patient = body.at("patient"), .plan = body.at("plan"), .ct = body.at("ct")};
    reason = body.at("reason");
  } catch (const Json::exception&) {
    return refusal(400, "xrays, patient, plan, ct and reason are expected.");
  }
  if (auto refused = refusal_of_reason(reason)) return *std::move(refused);
  return json_answer({{"session", room_.choose(name, ids, reason, who.user)}});
}

HttpResponse Screen::withdraw_choice(const HttpRequest& request, const SignedIn& who, const std::string& name) {
  if (!who.roles.contains(Role::kRegister)) return refusal(403, fmt::format("{} may not choose.", who.user));
  if (!has_type_json(request)) return refusal(415, "JSON is expected.");
  std::string reason;
  try {
    reason = Json::parse(request.body).at("reason");
  } catch (const Json::exception&) {
    return refusal(400, "reason is expected.");
  }
  if (auto refused = refusal_of_reason(reason)) return *std::move(refused);
  room_.withdraw_choice(name, reason, who.user);
  return json_answer({{"withdrawn", name}});
}

HttpResponse Screen::decide(const HttpRequest& request, const SignedIn& who, const std::string& name) {
  if (!who.roles.contains(Role::kRelease)) return refusal(403, fmt::format("{} may not decide.", who.user));
  if (!has_type_json(request)) return refusal(415, "JSON is expected.");
  Decision decision{.session = name, .by = who.user};
  try {
    const Json body = Json::parse(request.body);
    const auto kind = decision_kind_from(body.at("decision").get<std::string>());
    if (!kind) return refusal(400, "decision is agreed, rejected, repeat or reopened.");
    decision.kind = *kind;
    decision.record = body.at("record");
    decision.reason = body.at("reason");
  } catch (const Json::exception&) {
    return refusal(400, "decision, record and reason are expected.");
  }
  if (auto refused = refusal_of_reason(decision.reason, decision.kind == DecisionKind::kAgreed))
    return *std::move(refused);
  room_.decide(decision);
  return json_answer({{"decided", to_string(decision.kind)}});
}

HttpResponse Screen::release(const HttpRequest& request, const SignedIn& who, const std::string& name) {
  if (!who.roles.contains(Role::kRelease)) return refusal(403, fmt::format("{} may not release.", who.user));
  if (!has_type_json(request)) return refusal(415, "JSON is expected.");
  ResultsTree::Seen seen;
  bool despite = false;
  try {
    const Json body = Json::parse(request.body);
    seen = {.record = body.at("record"), .objection = body.at("objection")};
    despite = body.at("despite");
  } catch (const Json::exception&) {
    return refusal(400, "record, objection and despite are expected.");
  }
  room_.release(name, seen, who.user, despite);
  return json_answer({{"released", name}});
}

// The version of the list, and a beat that changes every few seconds: a browser that hears nothing has lost the server.
// The stream ends when the user's time is over.
HttpResponse Screen::events(const HttpRequest& request) {
  return {.body = "",
          .headers = {{"X-Accel-Buffering", "no"}},  // of nginx as a proxy
          .events = [this, request]() -> std::optional<std::string> {
            if (!sign_ins_.of(request, SignIns::Use::kStays)) return std::nullopt;
            const auto seen = room_.seen();
            return Json{{"version", seen->version},
                        {"engine", seen->does_engine_run ? "runs" : "stopped"},
                        {"beat", clock_.now().time_since_epoch() / kBeat}}
                .dump();
          }};
}

}  // namespace isoshift
