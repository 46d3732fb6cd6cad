#include "io/report/html.h"

#include <fmt/format.h>
#include <openssl/evp.h>

namespace isoshift {

std::string html_escaped(std::string_view text) {
  std::string result;
  for (const char c : text) switch (c) {
      case '&': result += "&amp;"; break;
      case '<': result += "&lt;"; break;
      case '>': result += "&gt;"; break;
      case '"': result += "&quot;"; break;
      case '\'': result += "&#39;"; break;
      default: result += c;
    }
  return result;
}

std::string percent_encoded(std::string_view path) {
  constexpr std::string_view kAsIs = "-._~/";
  std::string result;
  for (const char c : path) {
    const bool is_letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9');
    if (is_letter || kAsIs.find(c) != std::string_view::npos)
      result += c;
    else
      result += fmt::format("%{:02X}", static_cast<unsigned char>(c));
  }
  return result;
}

std::string data_uri(std::string_view type, std::string_view bytes) {
  std::string base64(4 * ((bytes.size() + 2) / 3) + 1, '\0');
  const int size =
      EVP_EncodeBlock(reinterpret_cast<unsigned char*>(base64.data()),
                      reinterpret_cast<const unsigned char*>(bytes.data()), static_cast<int>(bytes.size()));
  base64.resize(static_cast<std::size_t>(size));
  return fmt::format("data:{};base64,{}", type, base64);
}

void fill(std::string& html, std::string_view placeholder, const std::string& by) {
  for (std::size_t at = html.find(placeholder); at != std::string::npos; at = html.find(placeholder, at + by.size()))
    html.replace(at, placeholder.size(), by);
}

}  // namespace isoshift
