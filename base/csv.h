#pragma once
// Cells of tables (RFC 4180).

#include <string>
#include <string_view>

namespace isoshift {

// Quoted where it must be.
std::string csv_quoted(std::string_view text);

// The same for people: no formula for a spreadsheet.
std::string csv_cell(std::string text);

}  // namespace isoshift
