#include "base/csv.h"

#include <csv.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

#include "base/error.h"

namespace isoshift {
namespace {

// The lines of a table as they come in. A line ends with LF, CR or both; so does a line within a cell.
class Lines {
 public:
  void add_cell(std::string_view cell) {
    rows_.back().cells.emplace_back(cell);
    for (std::size_t n = 0; n < cell.size(); ++n)
      if (cell[n] == '\n' || (cell[n] == '\r' && !(n + 1 < cell.size() && cell[n + 1] == '\n'))) ++line_;
    ended_with_cr_ = false;
  }
  void end_line(int character) {
    const bool is_of_crlf = ended_with_cr_ && character == '\n';
    ended_with_cr_ = character == '\r';
    if (is_of_crlf) return;
    rows_.push_back({.line = ++line_, .cells = {}});
  }
  int line() const { return line_; }
  std::vector<CsvTable::Row> take_rows() { return std::move(rows_); }

 private:
  int line_ = 1;
  std::vector<CsvTable::Row> rows_ = {{.line = 1, .cells = {}}};
  bool ended_with_cr_ = false;
};

}  // namespace

std::string csv_quoted(std::string_view text) {
  if (text.find_first_of(",\"\r\n") == std::string_view::npos) return std::string(text);
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string csv_cell(std::string text) {
  if (!text.empty() && std::string_view("=+-@\t\r").find(text.front()) != std::string_view::npos)
    text.insert(text.begin(), '\'');
  return csv_quoted(text);
}

std::optional<double> number_in_cell(std::string_view cell) {
  constexpr const char* kBlanks = " \t";
  const std::size_t first = cell.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return std::nullopt;
  cell = cell.substr(first, cell.find_last_not_of(kBlanks) + 1 - first);
  if (cell.starts_with('+') && !cell.starts_with("+-")) cell.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  const bool is_whole = error == std::errc() && end == cell.data() + cell.size();
  return is_whole && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

CsvTable csv_table(std::string_view text, const std::string& where, char separator) {
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF"))
    throw Error(fmt::format("{}: is in UTF-16, expected UTF-8 (in a spreadsheet: \"CSV UTF-8\")", where));
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  Lines lines;
  csv_parser parser{};
  csv_init(&parser, CSV_STRICT | CSV_STRICT_FINI | CSV_APPEND_NULL | CSV_REPALL_NL);
  csv_set_delim(&parser, static_cast<unsigned char>(separator));
  // libcsv calls back for every cell and every end of a line.
  const auto on_cell = [](void* cell, std::size_t size, void* to) {
    static_cast<Lines*>(to)->add_cell({static_cast<const char*>(cell), size});
  };
  const auto on_end = [](int character, void* to) { static_cast<Lines*>(to)->end_line(character); };
  const bool is_whole = csv_parse(&parser, text.data(), text.size(), on_cell, on_end, &lines) == text.size() &&
                        csv_fini(&parser, on_cell, on_end, &lines) == 0;
  const int problem = csv_error(&parser);
  csv_free(&parser);
  if (!is_whole)
    throw Error(fmt::format(
        "{}, line {}: is no table of cells between commas: {}", where, lines.line(),
        problem == CSV_EPARSE ? "a quotation mark is missing, or stands within a cell" : csv_strerror(problem)));
  std::vector<CsvTable::Row> rows = lines.take_rows();
  CsvTable table{.columns = std::move(rows.front().cells), .rows = {}};
  if (separator == ',' && table.columns.size() == 1)
    for (const auto& [other, name] : {std::pair(';', "semicolons"), std::pair('\t', "tabulators")})
      if (table.columns.front().find(other) != std::string::npos)
        throw Error(
            fmt::format("{}, line 1: {} separate the cells, expected commas, and numbers with a decimal point. A "
                        "spreadsheet set to a language with decimal commas writes tables like this",
                        where, name));
  // Spreadsheets write cells without anything in them where there once was something.
  const auto has_nothing = [](const CsvTable::Row& row) {
    return std::ranges::all_of(row.cells, [](const std::string& cell) { return cell.empty(); });
  };
  std::erase_if(rows, has_nothing);
  const auto is_unused = [&](std::size_t column) {
    return table.columns[column].empty() && std::ranges::all_of(rows, [&](const CsvTable::Row& row) {
             return row.cells.size() == table.columns.size() && row.cells[column].empty();
           });
  };
  while (table.columns.size() > 1 && is_unused(table.columns.size() - 1)) {
    table.columns.pop_back();
    for (CsvTable::Row& row : rows) row.cells.pop_back();
  }
  for (auto column = table.columns.begin(); column != table.columns.end(); ++column)
    if (!column->empty() && std::find(table.columns.begin(), column, *column) != column)
      throw Error(fmt::format("{}: has the column {} twice", where, *column));
  for (const CsvTable::Row& row : rows)
    if (row.cells.size() != table.columns.size())
      throw Error(fmt::format("{}, line {}: {} cells, expected {} as in the first line", where, row.line,
                              row.cells.size(), table.columns.size()));
  table.rows = std::move(rows);
  return table;
}

}  // namespace isoshift
