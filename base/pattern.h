#pragma once
// A regular expression in ECMAScript's grammar. std::regex costs every source that uses it 2 s to compile: so it is
// compiled once, in pattern.cc.

#include <memory>
#include <string>

namespace isoshift {

class Pattern {
 public:
  enum class Case { kAsWritten, kAny };
  explicit Pattern(const char* expression, Case letters = Case::kAsWritten);
  ~Pattern();

  // Whether the whole text is as the expression says.
  bool matches(const std::string& text) const;
  // The text without all parts that are as the expression says.
  std::string removed_from(const std::string& text) const;

 private:
  struct Compiled;
  std::unique_ptr<const Compiled> compiled_;
};

}  // namespace isoshift
