#include "serve/view_screen.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "base/error.h"
#include "serve/answers.h"
#include "serve/pages/icon.svg.h"
#include "serve/pages/manual.css.h"
#include "serve/pages/manual.html.h"
#include "serve/pages/manual.js.h"
#include "serve/pages/manual_view.js.h"
#include "serve/pages/pose.js.h"
#include "serve/pages/room.css.h"
#include "serve/pages/shared.js.h"

namespace isoshift {
namespace {

constexpr std::array kViewPages = {Page{"/", kHtml, kManualHtml},
                                   Page{"/manual.js", kScript, kManualJs},
                                   Page{"/manual_view.js", kScript, kManualViewJs},
                                   Page{"/pose.js", kScript, kPoseJs},
                                   Page{"/shared.js", kScript, kSharedJs},
                                   Page{"/manual.css", kStyles, kManualCss},
                                   Page{"/room.css", kStyles, kRoomCss},
                                   Page{"/icon.svg", kSvg, kIconSvg}};
constexpr std::string_view kOpen = "/open/", kManualApi = "/api/manual/";

}  // namespace

HttpResponse ViewScreen::open(const HttpRequest& request, const std::string& word) {
  const SignIns::Attempt attempt = sign_ins_.sign_in(user_, word, request.from);
  if (!attempt.cookie) return refusal(403, "This address has been used, or is wrong. Start isoshift view again.");
  HttpResponse response = see_other("/");
  response.headers.emplace_back(
      "Set-Cookie", fmt::format("{}={}; Path=/; HttpOnly; SameSite=Strict", sign_in_cookie(request), *attempt.cookie));
  return response;
}

HttpResponse ViewScreen::answer(const HttpRequest& request) {
  const bool is_read = request.method == "GET";
  if (!is_read && request.method != "POST") return refusal(405, "GET or POST is expected");
  if (is_read && request.path.starts_with(kOpen)) return open(request, request.path.substr(kOpen.size()));
  const std::optional<SignedIn> who = sign_ins_.of(request);
  if (!who) return refusal(403, "Open the address that isoshift view has printed.");
  if (is_read) {
    const auto* page = std::ranges::find(kViewPages, request.path, &Page::path);
    if (page != kViewPages.end()) return {.type = std::string(page->type), .body = page->text};
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
