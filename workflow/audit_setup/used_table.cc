#include <fmt/format.h>
#include <fmt/ranges.h>

#include <charconv>
#include <cmath>
#include <map>

#include "base/csv.h"
#include "base/error.h"
#include "base/text_file.h"
#include "workflow/audit_setup/used_shifts.h"

namespace isoshift {
namespace {

std::vector<std::string> split_header() {
  std::vector<std::string> names = {"session"};
  names.insert(names.end(), kCouchColumns.begin(), kCouchColumns.end());
  return names;
}

std::optional<double> number_of(const std::string& cell, const std::string& where) {
  const std::size_t first = cell.find_first_not_of(" \t");
  if (first == std::string::npos) return std::nullopt;
  const std::string text = cell.substr(first, cell.find_last_not_of(" \t") + 1 - first);
  const char *begin = text.data() + (text.starts_with('+') ? 1 : 0), *end = text.data() + text.size();
  double value = 0.0;
  const auto [stopped, error] = std::from_chars(begin, end, value);
  if (error != std::errc() || stopped != end || !std::isfinite(value))
    throw Error(fmt::format(
        "{}: \"{}\" is not a finite number; expected mm or degrees with a decimal point, or nothing", where, cell));
  constexpr double kMost = 1000.0;  // mm or degrees; no couch moves that far
  if (std::abs(value) > kMost)
    throw Error(fmt::format("{}: {:g} is no couch shift; expected mm or degrees", where, value));
  return value;
}

}  // namespace

std::string used_shifts_header() { return fmt::format("{}", fmt::join(split_header(), ",")); }

void read_used_table(const std::filesystem::path& table, std::vector<AuditedSession>& sessions) {
  const std::string where = table.string();
  const CsvTable rows = csv_table(text_of_file(table), where);
  const std::vector<std::string> header = split_header();
  if (rows.columns != header)
    throw Error(fmt::format("{}, line 1: the columns are \"{}\", expected {}", where, fmt::join(rows.columns, ","),
                            used_shifts_header()));
  if (rows.rows.empty()) throw Error(fmt::format("{}: names no session", where));
  std::map<std::string, AuditedSession*> by_name;
  for (AuditedSession& session : sessions) by_name[session.name] = &session;
  for (const auto& [number, cells] : rows.rows) {
    const std::string line = fmt::format("{}, line {}", where, number);
    const auto found = by_name.find(cells.front());
    if (found == by_name.end())
      throw Error(fmt::format(
          "{}, column session: there is no session \"{}\"; the folder of the result has this name, with the folders "
          "above it where two have one name (as in \"{}\")",
          line, cells.front(), sessions.front().name));
    AuditedSession& session = *found->second;
    if (!session.used_from.empty())
      throw Error(fmt::format("{}, column session: \"{}\" is there twice; the first time in {}", line, session.name,
                              session.used_from));
    session.used_from = line;
    for (std::size_t axis = 0; axis < session.used.size(); ++axis)
      session.used[axis] = number_of(cells[axis + 1], fmt::format("{}, column {}", line, kCouchColumns[axis]));
  }
}

}  // namespace isoshift
