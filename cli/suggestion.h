#pragma once
// What a mistyped word probably meant.

#include <span>
#include <string>
#include <string_view>

namespace isoshift {

// The candidate that differs least from the word, if that is by at most a third of its letters, each inserted, left
// out, replaced or exchanged with its neighbor (Damerau and Levenshtein); otherwise an empty text.
std::string suggestion(std::string_view word, std::span<const std::string> candidates);

}  // namespace isoshift
