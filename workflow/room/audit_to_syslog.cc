#include "workflow/room/audit_to_syslog.h"

#include <syslog.h>

#include <algorithm>
#include <exception>
#include <vector>

#include "io/report/result_folder.h"
#include "workflow/room/audit_message.h"

namespace isoshift {
namespace {

AuditContext context_of(const nlohmann::ordered_json& line, const std::filesystem::path& results,
                        const std::string& site, const std::vector<DicomPeer>& peers) {
  AuditContext context{.site = site, .identity = {}, .called_aet = "", .host = ""};
  const auto peer = std::ranges::find(peers, line.value("peer", ""), &DicomPeer::name);
  if (peer != peers.end()) {
    context.called_aet = peer->called_aet;
    context.host = peer->host;
  }
  try {
    if (line.contains("session"))
      context.identity = read_report(results / "sessions" / line["session"].get<std::string>()).identity;
  } catch (const std::exception&) {  // a damaged result: the message tells the rest
    return context;
  }
  return context;
}

}  // namespace

AuditLog::Mirror audit_to_syslog(const WatchFile& watch) {
  return [results = watch.results, site = watch.site.name, peers = watch.peers](const nlohmann::ordered_json& line) {
    if (!has_audit_message(line)) return;  // a result need not be read
    if (const auto message = audit_message(line, context_of(line, results, site, peers)))
      ::syslog(LOG_AUTHPRIV | LOG_NOTICE, "%s", message->c_str());  // NOLINT(cppcoreguidelines-pro-type-vararg)
  };
}

}  // namespace isoshift
