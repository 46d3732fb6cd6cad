#pragma once
// A commissioning as files, and for a terminal.

#include <string>

#include "workflow/commission/commission.h"

namespace isoshift {

std::string commission_text(const Commission& commission);

// A line per position or move and axis, in mm and degrees (RFC 4180).
std::string commission_csv(const Commission& commission);

// `pdf_sha256`, `csv_sha256`: of the files beside it; empty: there are none.
std::string commission_json(const Commission& commission, const std::string& pdf_sha256, const std::string& csv_sha256);

// A4: what passed and failed, the errors per axis as a chart, what was not tested, and the sessions. Ends with lines to
// sign, or with the name of the person whose key signs.
std::string commission_pdf(const Commission& commission, bool is_signed_by_key);

// Words that the terminal and the PDF share.
inline constexpr const char* kNoErrors = "not determined by the X-rays, or not known";
struct CommissionWords {
  std::string title, outcome, known_from;
  std::array<std::string, 6> axes;  // "x (to the right)"
  std::string sigma;                // what the uncertainties hold
  std::vector<std::string> tested, untested;
};
CommissionWords words_of(const Commission& commission);

}  // namespace isoshift
