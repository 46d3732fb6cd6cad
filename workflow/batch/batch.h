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
  std::filesystem::path cases, output;  // a folder of files or a manifest; the folder of the batch
  int jobs = 1;                         // cases at the same time, each in a process of its own
  std::optional<Shard> shard;           // registers only this part; unset: all cases
  bool takes_earlier_scan = false;      // of a folder of files: registers what an earlier run found in it
  std::vector<std::string> kept;        // what every run of this batch must say alike, as on the command line
};

// The cases of a manifest; of a folder, those found in it. Tells the observer which X-rays belong to no case.
std::vector<BatchCase> cases_of(const BatchOptions& options, Observer& observer);

class Batch {
 public:
  // Makes the folder of the batch, or opens that of one with the same options.
  Batch(const BatchOptions& options, Observer& observer);

  const BatchFolder& folder() const { return folder_; }

  // Registers the cases that have not ended. False where it was asked to end before all had.
  bool run();

  // What a worker process does: registers the cases whose names come on standard input.
  void serve();

  // Of all cases, or of those of the shard.
  BatchSummary summary() const { return summary_of(folder_, cases_); }

  // The command line that goes on with this batch, without the program.
  std::vector<std::string> arguments() const;

 private:
  bool register_all();

  const BatchOptions& options_;
  Observer& observer_;
  std::vector<BatchCase> cases_;
  BatchFolder folder_;
};

}  // namespace isoshift
