#pragma once
// Answers that several screens give.

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "serve/http_message.h"

namespace isoshift {

inline constexpr std::string_view kHtml = "text/html; charset=utf-8", kScript = "text/javascript; charset=utf-8",
                                  kStyles = "text/css; charset=utf-8", kSvg = "image/svg+xml";

// A file of serve/pages/ and its address.
struct Page {
  std::string_view path, type;
  const char* text;
  bool is_for_all = false;  // also for those who are not signed in
};

HttpResponse json_answer(const nlohmann::ordered_json& json, int status = 200);
HttpResponse refusal(int status, const std::string& why);
HttpResponse see_other(const std::string& place);

// The report of a result, report.html. It brings its own script and styles, and pictures as data, and runs in a frame
// of a page of this program, apart from everything else here.
HttpResponse report_answer(std::string html);

// A form of another site can send no JSON without this program's consent.
bool has_type_json(const HttpRequest& request);

}  // namespace isoshift
