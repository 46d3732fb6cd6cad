#include "base/csv.h"

#include <csv.h>
#include <fmt/format.h>

#include <utility>

#include "base/error.h"

namespace isoshift {

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

CsvTable csv_table(std::string_view text, const std::string& where) {
  if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF"))
    throw Error(fmt::format("{}: is in UTF-16, expected UTF-8 (in a spreadsheet: \"CSV UTF-8\")", where));
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  using Lines = std::vector<std::vector<std::string>>;
  Lines lines(1);
  csv_parser parser{};
  csv_init(&parser, CSV_STRICT | CSV_STRICT_FINI | CSV_APPEND_NULL | CSV_REPALL_NL);
  // libcsv calls back for every cell and every end of a line.
  const auto on_cell = [](void* cell, std::size_t size, void* to) {
    static_cast<Lines*>(to)->back().emplace_back(static_cast<const char*>(cell), size);
  };
  const auto on_line = [](int, void* to) { static_cast<Lines*>(to)->emplace_back(); };
  const bool whole = csv_parse(&parser, text.data(), text.size(), on_cell, on_line, &lines) == text.size() &&
                     csv_fini(&parser, on_cell, on_line, &lines) == 0;
  const int problem = csv_error(&parser);
  csv_free(&parser);
  if (!whole) throw Error(fmt::format("{}, line {}: {}", where, lines.size(), csv_strerror(problem)));
  CsvTable table{.columns = std::move(lines.front()), .rows = {}};
  for (std::size_t n = 1; n < lines.size(); ++n) {
    if (lines[n].empty() || (lines[n].size() == 1 && lines[n].front().empty())) continue;
    if (lines[n].size() != table.columns.size())
      throw Error(fmt::format("{}, line {}: {} cells, expected {} as in the first line", where, n + 1, lines[n].size(),
                              table.columns.size()));
    table.rows.push_back({.line = static_cast<int>(n + 1), .cells = std::move(lines[n])});
  }
  return table;
}

}  // namespace isoshift
