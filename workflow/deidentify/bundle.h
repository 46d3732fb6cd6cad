#pragma once
// What somebody else needs to see why a result is what it is: for a report of a fault.

#include <filesystem>
#include <vector>

#include "workflow/deidentify/deidentify_study.h"

namespace isoshift {

struct BundleOptions {
  std::filesystem::path result;              // folder of register
  std::vector<std::filesystem::path> study;  // files or folders that hold what was registered
  std::filesystem::path output;
  bool overwrite = false;
};

// Writes into `output`: study/, the CT, the plan, its structure set and the X-rays that the result names,
// de-identified; result/, the result and its reports under the same pseudonyms; versions.txt; README.txt, which says
// how the study is registered again. Throws Error if one of these objects is not in `study`, or the CT, an X-ray or the
// plan is another file than that which was registered.
DeidentifiedFiles write_bundle(const BundleOptions& options, Observer& observer);

}  // namespace isoshift
