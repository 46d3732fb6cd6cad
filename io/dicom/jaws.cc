#include "io/dicom/jaws.h"

#include <algorithm>
#include <string>
#include <vector>

namespace isoshift {

void add_jaws(const DicomItem& device, JawOpenings& openings) {
  constexpr double kClosedMm = 0.5;  // leaves that are no farther apart are closed
  const std::string type = device.text(DCM_RTBeamLimitingDeviceType).value_or("");
  const std::vector<double> positions_mm = device.numbers(DCM_LeafJawPositions);
  // Positions come in two halves: first of all leaves at the lower side, then of those opposite.
  if (positions_mm.size() < 2 || positions_mm.size() % 2 != 0 || type.empty()) return;
  const auto half = positions_mm.begin() + static_cast<std::ptrdiff_t>(positions_mm.size() / 2);
  JawOpening opening{1e9, -1e9};
  for (auto lower = positions_mm.begin(), upper = half; upper != positions_mm.end(); ++lower, ++upper) {
    if (!(*upper - *lower > kClosedMm)) continue;
    opening = {std::min(opening.from_mm, *lower), std::max(opening.to_mm, *upper)};
  }
  if (!(opening.to_mm > opening.from_mm)) return;
  std::optional<JawOpening>& axis = type.ends_with('X') ? openings.x : openings.y;
  axis = axis ? JawOpening{std::max(axis->from_mm, opening.from_mm), std::min(axis->to_mm, opening.to_mm)} : opening;
}

}  // namespace isoshift
