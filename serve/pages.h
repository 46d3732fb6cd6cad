#pragma once
// The static files of serve/pages/ and their addresses.

#include <optional>
#include <string>

#include "serve/http_message.h"

namespace isoshift {

// A page that more than one address shows.
enum class Page { kSessions, kSession, kManual, kTrend, kChoose, kSignIn };
HttpResponse page_answer(Page page);

// Scripts, styles and pictures: an answer for their addresses, nothing for others. They tell nothing of patients.
std::optional<HttpResponse> static_answer(const std::string& path);

}  // namespace isoshift
