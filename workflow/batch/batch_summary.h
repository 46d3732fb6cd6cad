#pragma once
// The outcome of a batch: summary.csv, summary.json, index.html, patients.html, and the same in words.

#include <string>
#include <vector>

#include "setup/setup_errors.h"
#include "setup/setup_result.h"
#include "workflow/batch/batch_folder.h"

namespace isoshift {

struct CaseEnd {
  std::string name;
  std::optional<SetupResult> report;  // without pictures; unset: the case failed, or has not ended
  std::string error;                  // why the case failed; empty without a report: the case has not ended
};

struct BatchSummary {
  std::vector<CaseEnd> cases;           // in the manifest's order
  std::vector<PatientErrors> patients;  // from accepted results with all six components
  std::optional<PopulationErrors> population;

  std::size_t accepted() const;
  std::size_t open() const;  // cases that have not ended
};
BatchSummary summary_of(const BatchFolder& folder, const std::vector<BatchCase>& cases);

// Replaces an earlier summary.
void write_summary(const BatchFolder& folder, const BatchSummary& summary);
std::string summary_json(const BatchSummary& summary);
std::string summary_text(const BatchSummary& summary);

}  // namespace isoshift
