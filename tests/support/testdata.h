#pragma once
// The files of testdata/, which the project's own tools made (testdata/README.md). No test changes them.

#include <filesystem>
#include <string>
#include <vector>

namespace isoshift {

// A folder or file there: testdata("head"), testdata("small/1/RTPLAN.dcm").
std::filesystem::path testdata(const std::string& name);

// The rows of a README's first table, below its head: cells without the spaces around them. Throws std::runtime_error
// if there is none.
std::vector<std::vector<std::string>> table_of(const std::filesystem::path& readme);

// The commands and words between backticks.
std::vector<std::string> code_in(const std::string& cell);

// "isoshift check FILE ..." as arguments, without the program's name. Words that begin with "testdata/" become paths of
// this repository.
std::vector<std::string> arguments_of(const std::string& command);

}  // namespace isoshift
