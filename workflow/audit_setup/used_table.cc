#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <map>

#include "base/csv.h"
#include "base/error.h"
#include "base/sha256.h"
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
  if (cell.find_first_not_of(" \t") == std::string::npos) return std::nullopt;
  const auto value = number_in_cell(cell);
  if (!value)
    throw Error(fmt::format(
        "{}: \"{}\" is not a finite number; expected mm or degrees with a decimal point, or nothing", where, cell));
  constexpr double kMost = 1000.0;  // mm or degrees; no couch moves that far
  if (std::abs(*value) > kMost)
    throw Error(fmt::format("{}: {:g} is no couch shift; expected mm or degrees", where, *value));
  return value;
}

}  // namespace

std::string used_shifts_header() { return fmt::format("{}", fmt::join(split_header(), ",")); }

std::string read_used_table(const std::filesystem::path& table, std::vector<AuditedSession>& sessions) {
  const std::string where = table.string();
  const std::string text = text_of_file(table);
  const CsvTable rows = csv_table(text, where);
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
  return sha256_of(text);
}

}  // namespace isoshift
