#include "workflow/batch/batch_manifest.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "base/csv.h"
#include "base/error.h"
#include "base/json_file.h"
#include "base/sha256.h"
#include "base/text_file.h"
#include "io/study/files_below.h"
#include "io/study/session_files.h"

namespace isoshift {
namespace {

namespace fs = std::filesystem;

constexpr std::array kColumns = {"case",   "study",   "ct",     "plan",        "structures",
                                 "images", "anatomy", "doubts", "xrays_sha256"};
constexpr std::array kLists = {"ct", "images", "doubts"};  // columns whose cells may hold several texts
constexpr char kBetween = ';';                             // the texts of one cell

using Row = std::map<std::string, std::vector<std::string>, std::less<>>;  // by column
struct NumberedRow {
  int line = 0;
  Row cells;
};

std::vector<std::string> parts_of(const std::string& cell) {
  std::vector<std::string> parts;
  std::size_t begin = 0;
  while (begin <= cell.size()) {
    const std::size_t end = std::min(cell.find(kBetween, begin), cell.size());
    if (end > begin) parts.push_back(cell.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

void check_column(const std::string& name, const std::string& where) {
  if (std::ranges::find(kColumns, name) == kColumns.end())
    throw Error(fmt::format("{}: \"{}\" is not a column; expected {}", where, name, fmt::join(kColumns, ", ")));
}

std::vector<NumberedRow> csv_rows(const std::string& text, const std::string& where) {
  const CsvTable table = csv_table(text, where);
  for (const std::string& name : table.columns) check_column(name, where);
  if (std::ranges::find(table.columns, "case") == table.columns.end())
    throw Error(fmt::format("{}: has no column case, which names the cases", where));
  std::vector<NumberedRow> rows;
  for (const CsvTable::Row& cells : table.rows) {
    NumberedRow row{.line = cells.line, .cells = {}};
    for (std::size_t column = 0; column < table.columns.size(); ++column) {
      const std::string& cell = cells.cells[column];
      row.cells[table.columns[column]] = std::ranges::find(kLists, table.columns[column]) != kLists.end()
                                             ? parts_of(cell)
                                             : (cell.empty() ? std::vector<std::string>() : std::vector{cell});
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

std::vector<NumberedRow> json_rows(const std::string& text, const std::string& where) {
  std::vector<NumberedRow> rows;
  std::size_t begin = 0;
  for (int line = 1; begin < text.size(); ++line) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    const std::string one = text.substr(begin, end - begin);
    begin = end + 1;
    if (one.find_first_not_of(" \t\r") == std::string::npos) continue;
    NumberedRow row{.line = line, .cells = {}};
    const std::string place = fmt::format("{}, line {}", where, line);
    const nlohmann::json object = json_from(one, place);
    try {
      for (const auto& [name, value] : object.get<std::map<std::string, nlohmann::json>>()) {
        check_column(name, place);
        row.cells[name] =
            value.is_array() ? value.get<std::vector<std::string>>() : std::vector{value.get<std::string>()};
      }
    } catch (const nlohmann::json::exception&) {
      throw Error(fmt::format("{}: expected a JSON object of texts and lists of texts", place));
    }
    rows.push_back(std::move(row));
  }
  return rows;
}

BatchCase case_of(const NumberedRow& row, const fs::path& folder, const std::string& where) {
  const auto many = [&](std::string_view column) {
    const auto found = row.cells.find(column);
    return found == row.cells.end() ? std::vector<std::string>() : found->second;
  };
  const auto one = [&](std::string_view column) {
    const std::vector<std::string> texts = many(column);
    if (texts.size() > 1)
      throw Error(fmt::format("{}, line {}: {} entries in {}, expected one", where, row.line, texts.size(), column));
    return texts.empty() ? std::string() : texts.front();
  };
  const auto path = [&](const std::string& text) { return text.empty() ? fs::path() : folder / text; };
  const auto paths = [&](std::string_view column) {
    std::vector<fs::path> all;
    for (const std::string& text : many(column)) all.push_back(folder / text);
    return all;
  };
  BatchCase one_case{.name = one("case"),
                     .parts = {.study = path(one("study")),
                               .ct = paths("ct"),
                               .images = paths("images"),
                               .plan = path(one("plan")),
                               .structures = path(one("structures")),
                               .doubts = many("doubts")},
                     .anatomy = one("anatomy"),
                     .xrays_sha256 = one("xrays_sha256")};
  const auto is_allowed = [](unsigned char c) { return std::isalnum(c) != 0 || c == '.' || c == '_' || c == '-'; };
  if (one_case.name.empty() || one_case.name.starts_with('.') || !std::ranges::all_of(one_case.name, is_allowed))
    throw Error(fmt::format("{}, line {}: case \"{}\": expected a name of letters, digits, \".\", \"_\" and \"-\"",
                            where, row.line, one_case.name));
  const StudyParts& parts = one_case.parts;
  if (parts.study.empty() && (parts.ct.empty() || parts.images.empty()))
    throw Error(
        fmt::format("{}, line {}: case {}: expected a study, or ct and images", where, row.line, one_case.name));
  return one_case;
}

// The folder of a CT if nothing but the CT lies below it, else the CT's files: a file that is added to the folder later
// is none of the CT.
std::vector<fs::path> ct_paths(const fs::path& top, const std::vector<fs::path>& files) {
  const fs::path folder = files.front().parent_path();
  for (const fs::path& file : files)
    if (file.parent_path() != folder) return files;
  return folder == top || files_below({folder}).size() != files.size() ? files : std::vector{folder};
}

template <class Text>  // or path
std::string joined(const std::vector<Text>& texts) {
  std::string cell;
  for (const Text& text : texts) cell += (cell.empty() ? "" : std::string(1, kBetween)) + fs::path(text).string();
  return cell;
}

}  // namespace

std::string BatchCase::ct_key() const { return parts.ct.empty() ? parts.study.string() : joined(parts.ct); }

std::string xrays_sha256_of(const BatchCase& one) { return sha256_of_files(files_below(one.parts.images)); }

std::vector<BatchCase> read_manifest(const fs::path& path) {
  std::string text = text_of_file(path);
  if (text.starts_with("\xEF\xBB\xBF")) text.erase(0, 3);
  const std::string where = path.string();
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  const bool is_json = first != std::string::npos && text[first] == '{';
  std::vector<BatchCase> cases;
  std::set<std::string> names;
  for (const NumberedRow& row : is_json ? json_rows(text, where) : csv_rows(text, where)) {
    cases.push_back(case_of(row, fs::absolute(path).parent_path(), where));
    if (!names.insert(cases.back().name).second)
      throw Error(fmt::format("{}, line {}: case {} is there twice", where, row.line, cases.back().name));
  }
  if (cases.empty()) throw Error(fmt::format("{}: holds no case", where));
  return cases;
}

std::string manifest_csv(const std::vector<BatchCase>& cases) {
  std::string csv = fmt::format("{}\n", fmt::join(kColumns, ","));
  for (const auto& [name, parts, anatomy, xrays_sha256, xray_uids] : cases) {
    for (const auto& paths : {parts.ct, parts.images})
      for (const fs::path& path : paths)
        if (path.string().find(kBetween) != std::string::npos)
          throw Error(fmt::format("{}: its name holds \"{}\", which separates the paths in a manifest. Rename it",
                                  path.string(), kBetween));
    csv += fmt::format("{},{},{},{},{},{},{},{},{}\n", name, csv_quoted(parts.study.string()),
                       csv_quoted(joined(parts.ct)), csv_quoted(parts.plan.string()),
                       csv_quoted(parts.structures.string()), csv_quoted(joined(parts.images)), anatomy,
                       csv_quoted(joined(parts.doubts)), xrays_sha256);
  }
  return csv;
}

std::vector<BatchCase> scan_cases(const fs::path& folder, bool other_xrays, Notes& notes) {
  const fs::path top = fs::absolute(folder).lexically_normal();
  StudyFiles files = scan_study({top});
  compare_copies(files);
  for (const std::string& reason : files.unreadable) notes.warnings.push_back(reason);
  std::ranges::move(drrs_left_aside(files), std::back_inserter(notes.left_aside));
  std::vector<BatchCase> cases;
  std::string why_none;  // in the words of the first X-rays that belong to no case
  for (const SessionFiles& session : sessions_of(files, other_xrays)) {
    for (const std::string& remark : session.remarks)
      notes.warnings.push_back(fmt::format("case {}: {}", session.name, remark));
    try {
      const StudyFiles own = files_for(session, files);
      StudyParts parts = choose_parts(own);
      if (const std::string absent = missing_ct_images(own); !absent.empty()) throw Error(absent + " are missing");
      if (const std::string reason = unreadable_beside(parts, files.unreadable); !reason.empty())
        throw Error("a file beside these X-rays may belong to them: " + reason);
      parts.ct = ct_paths(top, parts.ct);
      std::ranges::copy(session.doubts, std::back_inserter(parts.doubts));
      for (const std::string& doubt : session.doubts)
        notes.warnings.push_back(fmt::format("case {}: {}", session.name, doubt));
      BatchCase& found = cases.emplace_back(BatchCase{.name = session.name, .parts = std::move(parts), .anatomy = ""});
      found.xrays_sha256 = xrays_sha256_of(found);
      for (const StudyFiles::Image& image : session.images) found.xray_uids.insert(image.sop_instance_uid);
    } catch (const Error& error) {
      const std::string why =
          fmt::format("{} and {} more X-rays belong to no case: {}", session.images.front().file.string(),
                      session.images.size() - 1, error.what());
      if (why_none.empty()) why_none = why;
      notes.warnings.push_back(why + "\n       Or name their files in a manifest; --scan writes one that you can edit");
    }
  }
  if (why_none.empty() && !files.other_formats.empty()) why_none = files.other_formats.front();
  if (cases.empty())
    throw Error(fmt::format("{}: holds no case; a case is X-rays with their CT and their plan{}{}", folder.string(),
                            why_none.empty() ? "" : ".\n       ", why_none));
  return cases;
}

}  // namespace isoshift
