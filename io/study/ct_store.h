#pragma once
// Keeps the CT that was read last, for studies that share it: thirty fractions are registered to one planning CT.

#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "io/dicom/ct_series.h"

namespace isoshift {

class CtStore {
 public:
  // Like read_ct_series(), including the notes. If the same files were read last, and have not been written since, they
  // are not read again.
  std::shared_ptr<const CtSeries> get(const std::vector<std::filesystem::path>& files, const Allowances& allowed,
                                      Notes& notes, const Progress& progress);

 private:
  using Versions = std::vector<std::pair<std::filesystem::path, std::filesystem::file_time_type>>;

  Versions versions_;
  Allowances allowed_;
  Notes said_;
  std::shared_ptr<const CtSeries> last_;
};

}  // namespace isoshift
