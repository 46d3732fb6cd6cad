#pragma once
// The hash chain of an audit log. Every line ends with its link, `before`: the SHA-256 of what stands in the log from
// the beginning of the line before that has a link (else from the beginning of the log) up to this line. Nothing can be
// changed, taken out or put in between two links without breaking one. Lines cut off at the end break none: a head that
// was kept elsewhere shows them.

#include <cstddef>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace isoshift {

// A text of a line; empty where it has none.
std::string text_in(const nlohmann::ordered_json& line, const char* key);

// The link of a line; empty where it has none.
std::string link_of(const nlohmann::ordered_json& line);

// Links a line, the last of its fields, to the text that it covers.
void link(nlohmann::ordered_json& line, std::string_view covered);

// What the next line's link covers, of the end of a log that begins with a line: the text from the last line with a
// link on. The whole text where no line has a link.
std::string_view unlinked_end(std::string_view text);

struct AuditChain {
  std::size_t lines = 0;
  std::size_t without_link = 0;      // before the first link: of a version of isoshift that made none
  std::vector<std::size_t> broken;   // numbers, from 1, of lines whose link is missing or does not fit
  std::vector<std::size_t> settled;  // broken ones that a later line, `repaired`, names
  std::set<std::string> links;
  std::string covered;  // what the link of the line to come covers

  std::string head() const;  // this link
};
AuditChain chain_of(std::string_view text);
// Adds lines to those of a chain. Only the last of them may be cut off, and nothing can be added after that.
void extend(AuditChain& chain, std::string_view lines);

}  // namespace isoshift
