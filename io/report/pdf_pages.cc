#include "io/report/pdf_pages.h"

#include <fmt/format.h>

#include <utility>

#include "io/report/report_page.h"

namespace isoshift {

PdfPages::PdfPages(const std::string& title, const std::string& program, std::string footer)
    : footer_(std::move(footer)) {
  canvas_.describe(title, program);
}

void PdfPages::footer() {
  constexpr double kBegin = 235.0;  // of what stands at the right
  const double at = kPageHeight - 30.0;
  canvas_.line({kMargin, at - 3.0}, {kMargin + kWidth, at - 3.0}, {.color = color::kLightGray});
  canvas_.text(kMargin, at, kDisclaimer, {.size = 7.5, .bold = true});
  canvas_.text(kMargin + kBegin, at, fmt::format("page {}  ·  {}", ++pages_, footer_),
               {.size = 7.0,
                .color = color::kGray,
                .align = TextStyle::Align::kRight,
                .width = kWidth - kBegin,
                .one_line = true});
}

void PdfPages::next_page() {
  footer();
  canvas_.new_page();
  y_ = kMargin;
}

void PdfPages::need(double height) {
  if (y_ + height > kBottom) next_page();
}

void PdfPages::paragraph(const std::string& text, TextStyle style, double indent) {
  style.width = kWidth - indent;
  const std::string shown = printable(text);
  need(canvas_.text_height(shown, style));
  y_ += canvas_.text(kMargin + indent, y_, shown, style) + 1.0;
}

void PdfPages::heading(const std::string& text) {
  constexpr double kLineBelow = 18.0;
  need(kLineBelow + 18.0);
  y_ += 7.0;
  y_ += canvas_.text(kMargin, y_, text, {.size = 10.0, .bold = true}) + 1.0;
}

void PdfPages::list(const std::string& title, const std::vector<std::string>& lines) {
  if (lines.empty()) return;
  heading(title);
  for (const std::string& line : lines) paragraph("· " + line);
}

void PdfPages::bar(double begin, Rgb color) { canvas_.fill(kMargin, begin, 6.0, y_ - begin, color); }

std::string PdfPages::finish() {
  footer();
  return canvas_.finish();
}

}  // namespace isoshift
