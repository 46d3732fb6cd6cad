#pragma once
// Words that nobody can guess: cookies, tokens, passwords.

#include <string>

namespace isoshift {

// 64 hexadecimal digits from the system's random numbers. Throws Error if it gives none.
std::string random_word();

}  // namespace isoshift
