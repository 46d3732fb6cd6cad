#pragma once
// Cells of tables (RFC 4180).

#include <string>
#include <string_view>

namespace isoshift {

// Quoted where it must be.
std::string csv_quoted(std::string_view text);

// The same for people: a text that a spreadsheet would take for a formula begins with an apostrophe.
std::string csv_cell(std::string text);

}  // namespace isoshift
