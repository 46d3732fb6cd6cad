#pragma once
// Text and pictures for HTML pages.

#include <string>
#include <string_view>

namespace isoshift {

std::string html_escaped(std::string_view text);

// A relative path as the value of an href (RFC 3986): a name with "#", "?", "%", ":", spaces or umlauts stays a name.
std::string percent_encoded(std::string_view path);

// Replaces every occurrence of a placeholder by a text.
void fill(std::string& html, std::string_view placeholder, const std::string& by);

// A data: URI of a picture. SVG drawings need one, too: the IDs of their elements would collide if several drawings
// were pasted into one page.
std::string data_uri(std::string_view type, std::string_view bytes);

}  // namespace isoshift
