#pragma once
// The formats of a result. All but JSON are made from a ReportPage, so that they show the same texts and numbers.

#include <span>
#include <string>

#include "io/report/report_page.h"

namespace isoshift {

// result.json, full precision. docs/result.schema.json describes it.
std::string json_report(const SetupResult& report);

// The result from which json_report() made this text, without pictures. Throws Error naming `where` for any other text.
SetupResult report_from_json(const std::string& json, const std::string& where);

// report.txt, for a terminal.
std::string text_report(const ReportPage& page);

// report.csv: a line of names, then one row (RFC 4180). Texts that a spreadsheet would take for a formula begin with '.
// Lengths are always in mm, whatever the site's unit.
std::string csv_report(const SetupResult& report);

// report.pdf: one sheet of A4 to sign, then the details.
std::string pdf_report(const SetupResult& report, const ReportPage& page);

// The pictures of a view as PNG files.
struct ViewPngs {
  std::string xray, drr_planned, drr_found;
};

// report.html: one page that needs no other file and no network, with the pictures of every view.
std::string html_report(const SetupResult& report, const ReportPage& page, std::span<const ViewPngs> pictures);

}  // namespace isoshift
