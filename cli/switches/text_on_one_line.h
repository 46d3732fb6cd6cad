#pragma once

#include <string>

namespace isoshift {

// Texts of a person that stand in the audit log and on pages. Throws UsageError naming the flag and what it expects if
// the text is blank, begins or ends with a space, holds control characters, or is not UTF-8.
void check_text_on_one_line(const std::string& flag, const std::string& text, const std::string& expected);

}  // namespace isoshift
