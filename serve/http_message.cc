#include "serve/http_message.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "base/error.h"

namespace isoshift {

std::string HttpRequest::header(const std::string& name) const {
  const auto found = headers.find(name);
  return found == headers.end() ? "" : found->second;
}

std::string HttpRequest::cookie(const std::string& name) const {
  const std::string all = header("cookie"), begin = name + "=";
  for (std::size_t at = 0; at < all.size();) {
    const std::size_t end = std::min(all.find(';', at), all.size());
    if (all.compare(at, begin.size(), begin) == 0) return all.substr(at + begin.size(), end - at - begin.size());
    at = std::min(all.find_first_not_of("; ", end), all.size());
  }
  return "";
}

std::string url_decoded(std::string_view text) {
  std::string decoded;
  for (std::size_t n = 0; n < text.size(); ++n) {
    if (text[n] != '%') {
      decoded += text[n];
      continue;
    }
    const std::string_view digits = text.substr(n + 1, 2);
    unsigned value = 0;
    const auto [end, failed] = std::from_chars(digits.data(), digits.data() + digits.size(), value, 16);
    if (digits.size() != 2 || end != digits.data() + 2 || failed != std::errc())
      throw Error(fmt::format("{}: a % without two hexadecimal digits", text));
    decoded += static_cast<char>(value);
    n += 2;
  }
  return decoded;
}

}  // namespace isoshift
