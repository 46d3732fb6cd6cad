#pragma once
// Registers many studies: the cases of a folder or a manifest, once each, in worker processes.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "workflow/batch/batch_folder.h"
#include "workflow/batch/batch_manifest.h"
#include "workflow/batch/batch_summary.h"
#include "workflow/observer.h"
#include "workflow/register/register_study.h"

namespace isoshift {

struct BatchOptions {
  RegisterOptions each;                 // for all cases
  std::filesystem::path cases, output;  // `cases`: a folder of files, or a manifest; `output`: the folder of the batch
  int jobs = 1;                         // cases registered at the same time, each in its own process
  std::optional<Shard> shard;           // registers only the cases of this shard; unset: all cases
  bool takes_earlier_scan = false;      // for a folder of files: registers the cases that an earlier run found in it
  std::vector<std::string> kept;        // flags that must be the same in every run of this batch
};

// The cases of a manifest, or the cases found in a folder. Tells the observer which X-rays belong to no case, and why.
std::vector<BatchCase> cases_of(const BatchOptions& options, Observer& observer);

class Batch {
 public:
  // Makes the folder of the batch, or opens the folder of an earlier run with the same options.
  Batch(const BatchOptions& options, Observer& observer);

  const BatchFolder& folder() const { return folder_; }

  // Registers the cases that have not ended. Returns false if it was asked to end before all cases had ended.
  bool run();

  // The summary of all cases, or of the cases of the shard.
  BatchSummary summary() const { return summary_of(folder_, cases_); }

  // The command line that continues this batch, without the program's name.
  std::vector<std::string> arguments() const;

 private:
  bool register_all();

  const BatchOptions& options_;
  Observer& observer_;
  std::vector<BatchCase> cases_;
  BatchFolder folder_;
};

}  // namespace isoshift
