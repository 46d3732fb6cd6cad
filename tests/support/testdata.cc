#include "tests/support/testdata.h"

#include <fmt/format.h>

#include <fstream>
#include <sstream>
#include <stdexcept>

namespace isoshift {
namespace {

constexpr std::string_view kFolder = "testdata/";

std::string trimmed(const std::string& text) {
  const auto begin = text.find_first_not_of(' ');
  return begin == std::string::npos ? "" : text.substr(begin, text.find_last_not_of(' ') - begin + 1);
}

std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::istringstream row(line.substr(1));
  for (std::string cell; std::getline(row, cell, '|');) cells.push_back(trimmed(cell));
  return cells;
}

}  // namespace

std::filesystem::path testdata(const std::string& name) {
  return std::filesystem::path(ISOSHIFT_SOURCE_DIR) / kFolder / name;
}

std::vector<std::vector<std::string>> table_of(const std::filesystem::path& readme) {
  std::ifstream file(readme);
  std::vector<std::vector<std::string>> rows;
  int lines = 0;
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with('|')) {
      if (lines > 0) break;
    } else if (++lines > 2) {
      rows.push_back(cells_of(line));
    }
  }
  if (rows.empty()) throw std::runtime_error(fmt::format("{}: has no table", readme.string()));
  return rows;
}

std::vector<std::string> code_in(const std::string& cell) {
  std::vector<std::string> code;
  std::istringstream parts(cell);
  bool is_code = false;
  for (std::string part; std::getline(parts, part, '`'); is_code = !is_code)
    if (is_code) code.push_back(part);
  return code;
}

std::vector<std::string> arguments_of(const std::string& command) {
  std::istringstream words(command);
  std::vector<std::string> arguments;
  for (std::string word; words >> word;)
    if (word != "isoshift")
      arguments.push_back(word.starts_with(kFolder) ? testdata(word.substr(kFolder.size())).string() : word);
  return arguments;
}

}  // namespace isoshift
