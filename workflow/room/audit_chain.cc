#include "workflow/room/audit_chain.h"

#include <algorithm>
#include <utility>

#include "base/sha256.h"

namespace isoshift {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kLink = "before";

Json parsed(std::string_view line) { return Json::parse(line, nullptr, false); }

// A line of a person who has looked at broken ones.
void settle(const Json& line, AuditChain& chain) {
  if (line.value("event", Json()) != "repaired" || !line.contains("lines") || !line["lines"].is_array()) return;
  for (const Json& number : line["lines"]) {
    const auto found = std::ranges::find_if(chain.broken, [&](std::size_t broken) { return number == broken; });
    if (found == chain.broken.end()) continue;
    chain.settled.push_back(*found);
    chain.broken.erase(found);
  }
}

}  // namespace

std::string text_in(const Json& line, const char* key) {
  if (!line.is_object()) return "";
  const auto found = line.find(key);
  return found != line.end() && found->is_string() ? found->get<std::string>() : "";
}

std::string link_of(const Json& line) { return text_in(line, kLink); }

void link(Json& line, std::string_view covered) { line[kLink] = sha256_of(covered); }

std::string_view unlinked_end(std::string_view text) {
  for (std::size_t end = text.size(); end > 0;) {
    const std::size_t newline = end >= 2 ? text.rfind('\n', end - 2) : std::string_view::npos;
    const std::size_t begin = newline == std::string_view::npos ? 0 : newline + 1;
    if (!link_of(parsed(text.substr(begin, end - begin))).empty()) return text.substr(begin);
    end = begin;
  }
  return text;
}

void extend(AuditChain& chain, std::string_view lines) {
  while (!lines.empty()) {
    const std::string_view text = lines.substr(0, std::min(lines.find('\n'), lines.size() - 1) + 1);
    lines.remove_prefix(text.size());
    const Json line = parsed(text);
    const std::string link = link_of(line);
    ++chain.lines;
    if (!link.empty()) {
      if (link != sha256_of(chain.covered))
        chain.broken.push_back(chain.lines);
      else
        settle(line, chain);
      chain.links.insert(link);
      chain.covered.clear();
    } else if (chain.links.empty()) {
      ++chain.without_link;
    } else if (line.is_object()) {  // a line that was cut off is none, and the next link covers it
      chain.broken.push_back(chain.lines);
    }
    chain.covered += text;
  }
}

AuditChain chain_of(std::string_view text) {
  AuditChain chain;
  extend(chain, text);
  return chain;
}

std::string AuditChain::head() const { return sha256_of(covered); }

}  // namespace isoshift
