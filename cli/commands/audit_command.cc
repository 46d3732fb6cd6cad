// isoshift room audit: whether the audit log of isoshift room watch is whole; records that a person has looked at
// broken lines.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>

#include "base/error.h"
#include "base/json_file.h"
#include "base/system_user.h"
#include "base/text_file.h"
#include "cli/commands/commands.h"
#include "cli/switches/text_on_one_line.h"
#include "workflow/room/audit_chain.h"
#include "workflow/room/audit_log.h"
#include "workflow/room/results_tree.h"

namespace isoshift {
namespace {

struct AuditOptions {
  std::filesystem::path log;
  std::vector<std::string> heads;
  std::string reason, by;
};

// What the releases beside a log, and the person, say that the log held; where each comes from.
std::vector<std::pair<std::string, std::string>> heads_to_find(const AuditOptions& options) {
  std::vector<std::pair<std::string, std::string>> heads;
  std::ranges::transform(options.heads, std::back_inserter(heads),
                         [](const std::string& head) { return std::pair(std::string("--head"), head); });
  const std::filesystem::path releases = options.log.parent_path() / "released";
  if (!std::filesystem::is_directory(releases)) return heads;
  for (const auto& entry : std::filesystem::directory_iterator(releases)) {
    if (entry.path().extension() != ".json") continue;
    const nlohmann::json release = read_json_file(entry.path()).json;
    if (release.is_object() && release.contains(kAuditHeadKey) && release[kAuditHeadKey].is_string())
      heads.emplace_back(entry.path().string(), release[kAuditHeadKey].get<std::string>());
  }
  return heads;
}

// Prints what is wrong with a log; whether it is whole.
bool examine(const AuditOptions& options, Console& console) {
  const AuditChain chain = chain_of(text_of_file(options.log));
  console.out << fmt::format("{} lines", chain.lines);
  if (chain.without_link > 0) console.out << fmt::format(", the first {} without links", chain.without_link);
  console.out << fmt::format("\nhead {}\n", chain.head());
  if (!chain.settled.empty())
    console.out << fmt::format("broken, and repaired by a person since: line {}\n", fmt::join(chain.settled, ", "));
  bool is_whole = chain.broken.empty();
  if (chain.links.empty()) {
    console.err << fmt::format(
        "error: {}: no line has a link (\"before\"), so that nothing tells whether it is whole\n",
        options.log.string());
    is_whole = false;
  }
  if (!chain.broken.empty())
    console.err << fmt::format(
        "error: {}: broken: line {}: this line, or lines before it, were changed, taken out or put in\n",
        options.log.string(), fmt::join(chain.broken, ", "));
  for (const auto& [from, head] : heads_to_find(options)) {
    if (head == chain.head() || chain.links.contains(head)) continue;
    console.err << fmt::format("error: {}: the log that held {} had other lines, or more\n", from, head);
    is_whole = false;
  }
  if (is_whole) console.out << "whole\n";
  return is_whole;
}

void repair(const AuditOptions& options, Console& console) {
  check_text_on_one_line("--by", options.by, "the name of the person who has looked");
  check_text_on_one_line("--repair", options.reason, "the reason");
  const AuditChain chain = chain_of(text_of_file(options.log));
  if (chain.broken.empty()) throw Error(fmt::format("{}: no link is broken", options.log.string()));
  const SystemUser user = system_user();
  nlohmann::ordered_json line = {{"by", options.by}, {"user", user.name}};
  if (!user.sudo_user.empty()) line["sudo_user"] = user.sudo_user;
  line["reason"] = options.reason;
  line["lines"] = chain.broken;
  AuditLog(options.log).append("repaired", line);
  console.out << fmt::format("recorded: {} has looked at line {}\n", options.by, fmt::join(chain.broken, ", "));
}

}  // namespace

void add_audit_command(CLI::App& app, Console& console, int& exit_status) {
  auto options = std::make_shared<AuditOptions>();
  CLI::App* command = app.add_subcommand("audit", "Check that the audit log of watch is whole");
  command->footer(
      "\nExample:\n  isoshift room audit /var/lib/isoshift/results/audit.jsonl\n\n"
      "Every line of the log holds the SHA-256 of the line before. Prints the head, the SHA-256 that the next\n"
      "line will hold: keep it elsewhere, and --head finds out whether lines were cut off since. The heads that\n"
      "the releases beside the log hold are looked for, too.\n\n"
      "Exit status: 0 whole, 1 not.");
  command->add_option("log", options->log, "The log, audit.jsonl")->required()->type_name("FILE");
  command->add_option("--head", options->heads, "A head that was printed earlier; may be repeated")
      ->type_name("SHA256")
      ->allow_extra_args(false);
  CLI::Option* reason =
      command
          ->add_option("--repair", options->reason,
                       "Record that a person has looked at the broken lines: why they are broken. Releases and "
                       "sending then go on, by what the log says now")
          ->type_name("REASON");
  CLI::Option* by = command->add_option("--by", options->by, "With --repair: name of that person")->type_name("NAME");
  reason->needs(by);
  by->needs(reason);
  command->callback([options, &console, &exit_status] {
    if (!options->reason.empty()) repair(*options, console);
    exit_status = examine(*options, console) ? kExitAccepted : kExitFailed;
  });
}

}  // namespace isoshift
