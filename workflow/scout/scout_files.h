#pragma once
// What registering a scout found, for a terminal and as files.

#include <array>
#include <string>

#include "base/output_folder.h"
#include "workflow/scout/register_scout.h"

namespace isoshift {

std::string scout_text(const ScoutRegistration& found, const ScoutRequest& request);

// `pdf_sha256`, `png_sha256`: of the files beside it; empty: there are none.
std::string scout_json(const ScoutRegistration& found, const ScoutRequest& request, const std::string& pdf_sha256,
                       const std::string& png_sha256);

// A4: the verdict, the offsets, and the scout beside the CT at both poses.
std::string scout_pdf(const ScoutRegistration& found, const ScoutRequest& request);

// The same pictures alone, larger.
std::string scout_png(const ScoutRegistration& found);

// Writes scout.pdf, scout.png and scout.json, and puts the folder in its place.
void write_scout_result(const ScoutRegistration& found, const ScoutRequest& request, OutputFolder& output);

// Words that the terminal and the PDF share, axis by axis.
inline constexpr std::array kScoutAxisWords = {"to the left",    "posterior",           "superior",
                                               "about the left", "about the posterior", "about the superior"};
struct ScoutAxisWords {
  std::string offset, repeatability;  // with units; empty where the axis is not seen
};
ScoutAxisWords words_of(const ScoutAxis& axis, std::size_t n);
std::string width_in_words(const ScoutRegistration& found);

}  // namespace isoshift
