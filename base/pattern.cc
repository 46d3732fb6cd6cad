#include "base/pattern.h"

#include <regex>

namespace isoshift {

struct Pattern::Compiled {
  std::regex regex;
};

Pattern::Pattern(const char* expression, Case letters)
    : compiled_(new Compiled{.regex = std::regex(expression, letters == Case::kAny
                                                                 ? std::regex::ECMAScript | std::regex::icase
                                                                 : std::regex::ECMAScript)}) {}
Pattern::~Pattern() = default;

bool Pattern::matches(const std::string& text) const { return std::regex_match(text, compiled_->regex); }

std::string Pattern::removed_from(const std::string& text) const {
  return std::regex_replace(text, compiled_->regex, "");
}

}  // namespace isoshift
