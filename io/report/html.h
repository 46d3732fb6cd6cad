#pragma once
// What may stand in HTML.

#include <string>
#include <string_view>

namespace isoshift {

std::string html_escaped(std::string_view text);

// Puts a text in the place of a placeholder, everywhere.
void fill(std::string& html, std::string_view placeholder, const std::string& by);

// Bytes as the address of a picture. Drawings of SVG must come in by it too: the names of their parts collide when
// several lie in one page.
std::string data_uri(std::string_view type, std::string_view bytes);

}  // namespace isoshift
