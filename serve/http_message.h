#pragma once
// Requests to the room's screen and the answers, as plain data. HttpServer carries them.

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace isoshift {

struct HttpRequest {
  std::string method;                          // "GET"
  std::string path;                            // decoded, without the query: "/api/sessions/3fa94c1e02b7"
  std::map<std::string, std::string> headers;  // names in lower case
  std::string body;
  std::string from;           // address of the other end
  bool is_encrypted = false;  // by TLS

  // Empty where the request has none.
  std::string header(const std::string& name) const;
  std::string cookie(const std::string& name) const;
};

struct HttpResponse {
  int status = 200;
  std::string type = "application/json";
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers;
  // Instead of a body a stream of events (text/event-stream): what this returns, whenever it differs from what it
  // returned before. It returns nothing once the stream must end.
  std::function<std::optional<std::string>()> events;
};

using HttpHandler = std::function<HttpResponse(const HttpRequest&)>;

// "a b/c" of "a%20b%2Fc". Throws Error for anything but two hexadecimal digits behind a %.
std::string url_decoded(std::string_view text);

}  // namespace isoshift
