#pragma once
// Pages of a PDF (A4), from top to bottom: text that is broken into lines, and a footer on every page.

#include <string>
#include <vector>

#include "io/report/canvas.h"

namespace isoshift {

class PdfPages {
 public:
  static constexpr double kPageWidth = 595.28, kPageHeight = 841.89;  // points
  static constexpr double kMargin = 34.0, kWidth = kPageWidth - 2.0 * kMargin;
  static constexpr double kBottom = kPageHeight - 40.0;  // below it the footer
  static constexpr double kText = 8.5;

  // `footer`: what stands at the right of every page, after its number. `program` is the creator.
  PdfPages(const std::string& title, const std::string& program, std::string footer);

  Canvas& canvas() { return canvas_; }
  double& y() { return y_; }  // where the next piece begins

  void next_page();
  void need(double height);  // goes to the next page if this one has less room
  void paragraph(const std::string& text, TextStyle style = {.size = kText}, double indent = 0.0);
  void heading(const std::string& text);
  void list(const std::string& title, const std::vector<std::string>& lines);  // nothing without lines

  // A colored bar beside everything that was drawn from `begin` on.
  void bar(double begin, Rgb color);

  std::string finish();

 private:
  void footer();

  Canvas canvas_{Canvas::Kind::kPdf, kPageWidth, kPageHeight};
  std::string footer_;
  double y_ = kMargin;
  int pages_ = 0;
};

}  // namespace isoshift
