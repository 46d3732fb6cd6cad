#pragma once
// A year of setups that were never X-rayed: what isoshift would have found of 60 fractions, and what a clinic used.

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "setup/setup_result.h"
#include "workflow/audit_setup/audited_session.h"

namespace isoshift {

struct MadeSession {
  SetupResult result;
  CouchAxes used;
};

// Ten patients of six fractions, two of them at a time on the same days. Patients differ by 2 mm and 1 degree,
// fractions by as much again; isoshift errs by 0.1 mm and 0.1 degrees, the clinic by 0.4 mm and 0.3 degrees.
struct MadeArchive {
  std::vector<MadeSession> sessions;  // in the order of time
  std::size_t swapped = 0;            // this session got the shift of the other patient of its day,
  std::size_t signs[2] = {};          // these a wrong sign,
  std::size_t sign_axes[2] = {};      // along these axes

  static std::string name_of(std::size_t session);  // "f07"
};

// Used shifts drift by `drift_mm` longitudinally in a year. `with_mistakes`: one swapped patient and two wrong signs.
MadeArchive made_archive(std::uint64_t seed, double drift_mm, bool with_mistakes);

// As read_archive() would read them.
std::vector<AuditedSession> audited(const MadeArchive& archive);

// Writes folders of results, each named as its session, and the table of used shifts.
void write_archive(const MadeArchive& archive, const std::filesystem::path& folder, const std::filesystem::path& table);

}  // namespace isoshift
