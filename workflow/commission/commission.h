#pragma once
// Commissioning of localization at a site: what its registered sessions of a phantom prove, and what they do not
// (AAPM TG-142, TG-179, TG-198, MPPG 2.b; docs/commands/commission.md).

#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "workflow/commission/localization.h"

namespace isoshift {

struct CommissionRequest {
  std::filesystem::path results;  // a folder of registered sessions
  Known known = Known::kReadOuts;
  std::filesystem::path known_poses;  // CSV; of known read-outs: empty
  std::filesystem::path site;         // empty: nothing is tested against limits
  std::filesystem::path key;          // a private key that signs; empty: unsigned
  std::string by;                     // who answers for it
  std::filesystem::path output;
  bool overwrite = false;
};

// Under which conditions sessions were measured. All others are untested.
struct Coverage {
  std::set<std::string> patient_positions, beams;  // "HFS"; "kV"
  std::set<std::string> view_angles;               // "0/270": the gantry angles of a session's views in whole degrees
  std::set<int> couch_deg;                         // of the patient support, whole degrees
  std::set<std::string> untested_positions() const;
};

struct Commission {
  std::string made_on, by, site_name, site_sha256, known_poses_sha256;
  std::optional<LocalizationLimits> limits;
  std::vector<NamedResult> sessions;  // that were used: accepted or for review
  struct LeftOut {
    std::string session, why;
  };
  std::vector<LeftOut> left_out;
  Coverage coverage;
  Localization localization;

  // Failed where a test failed or a session was left out; passed where the site's limits and the polarity of all axes
  // passed, in every patient position and beam of the sessions.
  Outcome outcome() const;
};

// Throws Error for what results_below(), read_known_poses() and localization_of() refuse, for too few sessions, and for
// sessions of several machines, programs, presets or machine profiles.
Commission commission_of(const CommissionRequest& request);

// Writes commission.pdf, commission.csv (a line per position or move and axis) and commission.json, which holds the
// hashes of the other two; with a key also commission.json.sig, the key's signature of commission.json.
void write_commission(const Commission& commission, const CommissionRequest& request);

}  // namespace isoshift
