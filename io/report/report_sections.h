#pragma once
// The second part of a report: what was understood, searched, checked and read.

#include <vector>

#include "io/report/report_page.h"

namespace isoshift {

// In the order of the report. `page` holds the first part.
std::vector<ReportPage::Section> report_sections(const SetupResult& report, const ShownShift& shown, LengthUnit unit,
                                                 const ReportPage& page);

}  // namespace isoshift
