#pragma once
// Stored values that say "no pixel here" (PS3.3 C.7.5.1.1.2).

#include <cstdint>
#include <optional>

#include "io/dicom/dicom_dataset.h"

namespace isoshift {

class PixelPadding {
 public:
  explicit PixelPadding(const DicomItem& dataset);

  bool is_given() const { return range_.has_value(); }
  bool holds(std::int32_t stored) const { return range_ && stored >= range_->least && stored <= range_->most; }

 private:
  struct Range {
    double least, most;
  };
  std::optional<Range> range_;
};

}  // namespace isoshift
