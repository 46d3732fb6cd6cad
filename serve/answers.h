#pragma once
// Answers that several screens give.

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "serve/http_message.h"

namespace isoshift {

inline constexpr std::string_view kHtml = "text/html; charset=utf-8";

HttpResponse json_answer(const nlohmann::ordered_json& json, int status = 200);
HttpResponse refusal(int status, const std::string& why);
HttpResponse see_other(const std::string& place);

// The report of a result, report.html. It brings its own script and styles, and pictures as data, and runs in a frame
// of a page of this program, apart from everything else here.
HttpResponse report_answer(std::string html);

// A form of another site can send no JSON without this program's consent.
bool has_type_json(const HttpRequest& request);

}  // namespace isoshift
