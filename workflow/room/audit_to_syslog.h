#pragma once
// The audit log of a results tree, in the system's log.

#include "io/config/watch_file.h"
#include "workflow/room/audit_log.h"

namespace isoshift {

// Writes lines that are DICOM audit messages (audit_message()) to the system's log (syslog(3), facility authpriv, which
// only administrators read).
AuditLog::Mirror audit_to_syslog(const WatchFile& watch);

}  // namespace isoshift
