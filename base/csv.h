#pragma once
// Cells of tables (RFC 4180).

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isoshift {

// Quoted where it must be.
std::string csv_quoted(std::string_view text);

// The same for people: a text that a spreadsheet would take for a formula begins with an apostrophe.
std::string csv_cell(std::string text);

// The finite number that a cell holds, as people write it: blanks around it and a plus sign are allowed. Nothing: it
// holds none.
std::optional<double> number_in_cell(std::string_view cell);

// A table whose first line names its columns. Every row has as many cells as there are columns; empty lines are left
// out.
struct CsvTable {
  struct Row {
    int line = 0;  // of the file, from 1: where the row begins
    std::vector<std::string> cells;
  };
  std::vector<std::string> columns;
  std::vector<Row> rows;
};

// Throws Error naming `where` and the line.
CsvTable csv_table(std::string_view text, const std::string& where, char separator = ',');

}  // namespace isoshift
