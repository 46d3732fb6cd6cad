#include "serve/answers.h"

namespace isoshift {

using Json = nlohmann::ordered_json;

HttpResponse json_answer(const Json& json, int status) {
  return {.status = status, .body = json.dump(-1, ' ', false, Json::error_handler_t::replace)};
}

HttpResponse refusal(int status, const std::string& why) { return json_answer({{"error", why}}, status); }

HttpResponse see_other(const std::string& place) { return {.status = 303, .headers = {{"Location", place}}}; }

HttpResponse report_answer(std::string html) {
  return {.type = std::string(kHtml),
          .body = std::move(html),
          .headers = {{"Content-Security-Policy",
                       "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
                       "frame-ancestors 'self'; sandbox allow-scripts"},
                      {"X-Frame-Options", "SAMEORIGIN"}}};
}

bool has_type_json(const HttpRequest& request) {
  return request.header("content-type").starts_with("application/json");
}

}  // namespace isoshift
