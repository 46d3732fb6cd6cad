#include "io/dicom/pixel_padding.h"

#include <algorithm>

namespace isoshift {

PixelPadding::PixelPadding(const DicomItem& dataset) {
  // The padding attributes are US or SS like the pixels (PS3.3 C.7.5.1.1.2); implicit VR files say US for both.
  const bool is_signed = dataset.required_number(DCM_PixelRepresentation) != 0;
  const auto value_of = [&](const DcmTagKey& tag) -> std::optional<double> {
    auto value = dataset.number(tag);
    if (value && is_signed && *value > 32767) *value -= 65536;
    return value;
  };
  const auto value = value_of(DCM_PixelPaddingValue);
  if (!value) return;
  const double limit = value_of(DCM_PixelPaddingRangeLimit).value_or(*value);
  range_ = Range{.least = std::min(*value, limit), .most = std::max(*value, limit)};
}

}  // namespace isoshift
