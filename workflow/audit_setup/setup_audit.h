#pragma once
// What an archive of sessions says, once the clinic's shifts are known. No file is read or written here: archive and
// used_shifts read, audit_files and audit_page write.

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "setup/agreement.h"
#include "setup/setup_errors.h"
#include "workflow/audit_setup/audited_session.h"
#include "workflow/audit_setup/differences.h"

namespace isoshift {

struct SetupAudit {
  std::string made_on;      // local_time()
  std::string used_sha256;  // of the table of used shifts; empty: there is none, or registration objects say it
  struct Axis {             // of the table top: used minus found
    std::optional<Agreement> without_outliers, of_all;  // nothing: nothing is compared
    std::optional<Drift> drift;                         // without outliers
    double scatter = 0.0;                               // robust standard deviation about the level
    bool looks_opposite = false;                        // used shifts agree better with the opposite of what was found
    bool looks_unrelated = false;  // used shifts tell hardly more of what was found than zero would
  };
  struct Outlier {
    std::size_t session = 0;  // in `sessions`
    std::vector<std::size_t> axes;
    std::string explanation;
  };
  // Errors of a population, with the margin for their translations.
  struct Population {
    PopulationErrors errors;
    std::array<double, 3> margin_mm{};
  };

  std::vector<AuditedSession> sessions;  // in the order of their times
  std::vector<std::string> of_no_use;    // files of used shifts that belong to no session, with the reason
  std::size_t counted = 0, compared = 0, patients = 0;
  std::array<Axis, 6> axes;
  double threshold = 0.0;  // in standard deviations; 0: too few sessions to call outliers
  std::vector<Outlier> outliers;
  std::vector<CouchAxes> level;                     // per session: the difference that the other sessions let expect
  std::array<std::optional<Drift>, 6> setup_drift;  // of the setup error found: kErrorComponents, IEC 61217 fixed
  std::optional<Population> uncorrected;            // setup errors as found, x, y, z
  std::optional<Population> corrected;              // what the used shifts leave, lateral, longitudinal, vertical

  const Outlier* outlier_of(std::size_t session) const;  // null: it is none
};

// Without made_on, used_sha256 and of_no_use.
SetupAudit audit_of(std::vector<AuditedSession> sessions);

}  // namespace isoshift
