#include "serve/view_screen.h"

#include "base/error.h"
#include "serve/answers.h"
#include "serve/pages.h"

namespace isoshift {
namespace {

constexpr std::string_view kOpen = "/open/", kManualApi = "/api/manual/";

}  // namespace

HttpResponse ViewScreen::open(const HttpRequest& request, const std::string& word) {
  const SignIns::Attempt attempt = sign_ins_.sign_in(user_, word, request.from);
  if (!attempt.cookie) return refusal(403, "This address has been used, or is wrong. Start isoshift view again.");
  HttpResponse response = see_other("/");
  response.headers.emplace_back("Set-Cookie", sign_in_cookie_header(request, *attempt.cookie));
  return response;
}

HttpResponse ViewScreen::answer(const HttpRequest& request) {
  const bool is_read = request.method == "GET";
  if (!is_read && request.method != "POST") return refusal(405, "GET or POST is expected");
  if (is_read && request.path.starts_with(kOpen)) return open(request, request.path.substr(kOpen.size()));
  const std::optional<SignedIn> who = sign_ins_.of(request);
  if (!who) return refusal(403, "Open the address that isoshift view has printed.");
  if (is_read) {
    if (request.path == "/") return page_answer(Page::kManual);
    if (auto file = static_answer(request.path)) return *std::move(file);
    if (request.path == "/api/me") return json_answer({{"user", who->user}, {"token", who->token}});
  } else if (request.header(kTokenHeader) != who->token) {
    return refusal(403, "The request does not come from a page of this program.");
  }
  if (!request.path.starts_with(kManualApi)) return refusal(404, "There is nothing at this address.");
  try {
    return manual_.answer(request, *who, request.path.substr(kManualApi.size()));
  } catch (const Error& error) {
    return refusal(409, error.what());
  }
}

}  // namespace isoshift
