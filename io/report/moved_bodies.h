#pragma once
// What bones did against the target, in words.

#include <string>

#include "io/report/report_page.h"

namespace isoshift {

inline constexpr const char* kMovedTitle = "What moved against the target";

// One sentence: how the spine bends on both sides of the target; where it does not, the bone that lies farthest off and
// the one that is turned most. Empty: the patient as a whole
// was registered, or the shift is withheld.
std::string bent_words(const ShownShift& shown, LengthUnit unit);

// A row per bone, the nearest to the target first.
ReportPage::Section moved_section(const ShownShift& shown, const std::vector<StructureMotion>& structures,
                                  LengthUnit unit);

}  // namespace isoshift
