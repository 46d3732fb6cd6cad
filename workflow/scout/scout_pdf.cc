// The PDF of a scout.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string>
#include <vector>

#include "base/version.h"
#include "io/report/drawings.h"
#include "io/report/pdf_pages.h"
#include "io/report/report_page.h"
#include "workflow/scout/scout_files.h"
#include "workflow/scout/scout_picture.h"

namespace isoshift {
namespace {

constexpr double kPicturesHeight = 540.0, kLegendHeight = 26.0;

class ScoutPdf {
 public:
  ScoutPdf(const ScoutRegistration& found, const ScoutRequest& request) : found_(found), request_(request) {}

  std::string write() {
    header();
    if (found_.verdict == Verdict::kRejected)
      pages_.paragraph("The offset is withheld: the result was rejected.");
    else
      table();
    pictures();
    pages_.list("Overrides: what a person supplied or allowed", found_.notes.overrides);
    pages_.list("Warnings", found_.notes.warnings);
    inputs();
    return pages_.finish();
  }

 private:
  static constexpr double kMargin = PdfPages::kMargin, kWidth = PdfPages::kWidth, kText = PdfPages::kText;

  static std::string program() { return fmt::format("isoshift {} ({})", kVersion, kCommit); }

  void header() {
    y_ += canvas_.text(kMargin, y_, "A CT against its own scout", {.size = 17.0, .bold = true}) + 4.0;
    pages_.paragraph(
        fmt::format("{}  ·  ID {}", name_for_people(found_.patient.patient_name), patient_in_words(found_.patient)));
    y_ += 4.0;
    const double begin = y_;
    y_ += 4.0;
    y_ += canvas_.text(kMargin + 12.0, y_, upper_case(to_string(found_.verdict)), {.size = 12.0, .bold = true});
    for (const std::string& reason : found_.reasons)
      y_ += canvas_.text(kMargin + 12.0, y_, printable(reason), {.size = kText, .width = kWidth - 12.0}) + 1.0;
    y_ += 4.0;
    pages_.bar(begin, verdict_color(found_.verdict));
    y_ += 6.0;
  }

  void table() {
    constexpr std::array kLeft = {0.0, 150.0, 300.0};
    const auto cell = [&](std::size_t column, const std::string& text, const TextStyle& style = {.size = kText}) {
      canvas_.text(kMargin + kLeft[column], y_, text, style);
    };
    const TextStyle names{.size = 8.0, .color = color::kGray};
    cell(0, "the patient's axis", names);
    cell(1, "offset, ± two sigma", names);
    cell(2, fmt::format("largest distance of {} other starts", found_.starts), names);
    y_ += 11.0;
    for (std::size_t n = 0; n < found_.axes.size(); ++n) {
      const ScoutAxisWords words = words_of(found_.axes[n], n);
      cell(0, kScoutAxisWords[n]);
      cell(1, words.offset.empty() ? "not seen by this scout" : words.offset);
      cell(2, words.repeatability);
      y_ += 11.0;
    }
    cell(0, "width of the scout across the table");
    cell(1, width_in_words(found_) + " times that of the CT");
    y_ += 13.0;
    pages_.paragraph(fmt::format(
        "The offset is where the anatomy of the CT lies in the scout, against where the CT says, at ({:.1f}, {:.1f}, "
        "{:.1f}) mm, the center of the CT.",
        found_.center_patient_mm.x(), found_.center_patient_mm.y(), found_.center_patient_mm.z()));
  }

  void pictures() {
    y_ += 6.0;
    if (PdfPages::kBottom - y_ < 0.6 * kPicturesHeight) pages_.need(kPicturesHeight);
    y_ += draw_scout(canvas_, kMargin, y_, kWidth, std::min(kPicturesHeight, PdfPages::kBottom - y_ - kLegendHeight),
                     found_.picture, found_.picture_aspect);
    pages_.paragraph(
        "Letters are the patient's directions; what is dimmed was not compared. Over one another, the scout is magenta "
        "and the CT green; of the difference, bright is where the scout is denser.");
  }

  void inputs() {
    pages_.list(
        "Registered",
        {fmt::format("CT series {}", found_.ct_series_instance_uid), fmt::format("scout {}", request_.scout.string()),
         fmt::format("SOP Instance UID {}, SHA-256 {}", found_.scout_sop_instance_uid, found_.scout_sha256),
         fmt::format("patient position of the scout: {}",
                     found_.scout_patient_position.empty() ? "not said" : found_.scout_patient_position),
         fmt::format("tube on the patient's {} side{}: gradient correlation {:.3f}, {:.3f} from the other side",
                     to_string(found_.tube), request_.tube ? " (--tube)" : ", where the scout matches better",
                     found_.match, found_.match_from_other_side),
         fmt::format("rendered by {} on {}", found_.renderer, found_.device)});
  }

  const ScoutRegistration& found_;
  const ScoutRequest& request_;
  PdfPages pages_{"A CT against its own scout", program(), program()};
  Canvas& canvas_ = pages_.canvas();
  double& y_ = pages_.y();
};

}  // namespace

std::string scout_pdf(const ScoutRegistration& found, const ScoutRequest& request) {
  return ScoutPdf(found, request).write();
}

}  // namespace isoshift
