#pragma once
// All sessions below a folder that isoshift has registered: results of register, of batch, and results trees of watch.

#include <filesystem>
#include <vector>

#include "workflow/audit_setup/audited_session.h"

namespace isoshift {

// Of what isoshift found, which shift is compared with what the clinic used.
enum class ComparedShift {
  kFull,          // all six components, as registration objects hold them
  kOfSitesCouch,  // what the couch of the site file can do of them
};

// In the order of their times. A result counts if it was accepted, if the time of its X-rays is known, and if no other
// result of any of its X-rays was made later. Results that do not count, and those that cannot be read, say why.
// Folders of results that watch or batch have put aside (superseded, by_hand, handed_over), and hidden folders, are
// passed over. Throws Error for a folder without results.
std::vector<AuditedSession> read_archive(const std::filesystem::path& folder, ComparedShift compared);

}  // namespace isoshift
