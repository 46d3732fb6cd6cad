#include <fmt/format.h>

#include <algorithm>

#include "io/report/drawings.h"
#include "io/report/formats.h"
#include "io/report/moved_bodies.h"
#include "io/report/pdf_pages.h"
#include "setup/shown_shift.h"

namespace isoshift {
namespace {

constexpr double kMargin = PdfPages::kMargin, kWidth = PdfPages::kWidth, kBottom = PdfPages::kBottom;
constexpr double kGap = 7.0;
constexpr std::size_t kReasonsOnFirstPage = 4;

class PdfReport {
 public:
  PdfReport(const SetupResult& report, const ReportPage& page)
      : report_(report),
        page_(page),
        pages_(page.title, page.program,
               fmt::format("{}  ·  patient ID {}", page.program, printable(report.identity.patient_id))) {
    y_ = kMargin - 6.0;
  }

  std::string write() {
    header();
    who();
    verdict();
    shift();
    numbers();
    const std::size_t shown = pictures(0, kBottom - sign_off_height() - conventions_height() - 2.0 * kGap, false);
    sign_off();
    conventions();
    pages_.next_page();
    if (shown < report_.views.size()) pictures(shown, kBottom, true);
    details();
    return pages_.finish();
  }

 private:
  void header() {
    canvas_.text(kMargin, y_, page_.title, {.size = 17.0, .bold = true});
    canvas_.text(kMargin + kWidth, y_ + 2.0, page_.program,
                 {.size = 8.0, .color = color::kGray, .align = TextStyle::Align::kRight});
    canvas_.text(kMargin + kWidth, y_ + 12.0, page_.disclaimer,
                 {.size = 8.0, .bold = true, .align = TextStyle::Align::kRight});
    y_ += 26.0;
  }

  void who() {
    constexpr std::size_t kMost = 9;  // all are in the details
    for (std::size_t n = 0; n < page_.who.size(); ++n) {
      if (n >= kMost - 1 && page_.who.size() > kMost && n + 1 < page_.who.size()) continue;  // the last one says when
      const ReportPage::Row& row = page_.who[n];
      const bool is_patient = row.name == "Patient", is_bent = row.name == kBent;
      canvas_.text(kMargin, y_, row.name, {.size = 8.0, .color = color::kGray});
      y_ += canvas_.text(kMargin + 58.0, y_ - (is_patient ? 1.5 : 0.0), row.value,
                         {.size = is_patient ? 10.5 : 8.5,
                          .bold = is_patient || is_bent,
                          .width = kWidth - 58.0,
                          .one_line = !is_bent}) +
            1.0;
    }
    y_ += kGap;
  }

  // On the first page every reason has one line; the details have all of it.
  void verdict() {
    constexpr double kIndent = 12.0;
    const double begin = y_;
    const auto line = [&](const std::string& text, double size, bool bold) {
      y_ += canvas_.text(kMargin + kIndent, y_, text,
                         {.size = size, .bold = bold, .width = kWidth - kIndent - 4.0, .one_line = true});
    };
    y_ += 3.0;
    line(page_.verdict_words, 12.0, true);
    for (std::size_t n = 0; n < std::min(kReasonsOnFirstPage, page_.reasons.size()); ++n)
      line("· " + page_.reasons[n], 8.5, false);
    if (page_.reasons.size() > kReasonsOnFirstPage)
      line(fmt::format("· and {} more, on the next page", page_.reasons.size() - kReasonsOnFirstPage), 8.5, false);
    line(page_.action_words, 9.5, page_.action == Action::kExceeds);
    for (const std::string& reason : page_.action_reasons) line("· " + reason, 8.5, false);
    y_ += 3.0;
    canvas_.fill(kMargin, begin, 6.0, y_ - begin, verdict_color(page_.verdict));
    canvas_.polygon(box(kMargin, begin, kWidth, y_ - begin), {.color = color::kLightGray});
    y_ += kGap;
  }

  static Polygon box(double x, double y, double width, double height) {
    return {{x, y}, {x + width, y}, {x + width, y + height}, {x, y + height}};
  }

  // The couch shift large, beside the drawing of the couch.
  void shift() {
    constexpr double kTextWidth = 0.64 * kWidth, kHeight = 142.0;
    const double begin = y_;
    canvas_.polygon(box(kMargin, begin, kWidth, kHeight), {.color = color::kBlack, .width = 1.2});
    draw_couch(canvas_, kMargin + kTextWidth, begin + 2.0, kWidth - kTextWidth - 4.0, kHeight - 6.0, report_, page_);
    const double x = kMargin + 8.0;
    canvas_.text(x, begin + 5.0, "MOVE THE COUCH BY", {.size = 10.0, .bold = true});
    if (page_.withheld) {
      canvas_.text(x, begin + 50.0, "withheld", {.size = 26.0, .bold = true});
      canvas_.text(x, begin + 86.0, "The result was rejected: there is no shift to apply.", {.size = 9.0});
    } else {
      canvas_.text(kMargin + kTextWidth, begin + 6.0, page_.couch_order,
                   {.size = 8.0, .color = color::kGray, .align = TextStyle::Align::kRight});
      double y = begin + 19.0;
      for (std::size_t n = 0; n < page_.couch.size(); ++n) y += couch_line(x, y, page_.couch[n], n < 3 ? 17.0 : 11.0);
      canvas_.text(x, y + 2.0, page_.couch_target, {.size = 8.0, .color = color::kGray});
    }
    y_ = begin + kHeight + kGap;
  }

  double couch_line(double x, double y, const Quantity& quantity, double size) {
    const double baseline = 0.5 * (size - 9.0);
    canvas_.text(x, y + 1.2 * baseline, quantity.name, {.size = 9.0});
    if (!quantity.is_number) {
      canvas_.text(x + 70.0, y + 1.2 * baseline, quantity.value + (quantity.words.empty() ? "" : ": " + quantity.words),
                   {.size = 9.0, .bold = true});
      return 1.22 * size;
    }
    canvas_.text(x + 130.0, y, quantity.value, {.size = size, .bold = true, .align = TextStyle::Align::kRight});
    canvas_.text(x + 134.0, y + 1.2 * baseline, quantity.unit, {.size = 9.0});
    canvas_.text(x + 155.0, y + 1.2 * baseline, quantity.words, {.size = 8.5, .bold = size > 12.0});
    return 1.22 * size;
  }

  // Setup error with uncertainty; beside it what the couch's display shows and what remains.
  void numbers() {
    if (page_.withheld) return;
    const double begin = y_, right = kMargin + 0.5 * kWidth + kGap;
    canvas_.text(kMargin, y_, "Setup error: where the patient lies", {.size = 8.5, .bold = true});
    y_ += 12.0;
    for (const Quantity& quantity : page_.setup_error) {
      canvas_.text(kMargin, y_, quantity.name, {.size = 8.0});
      canvas_.text(kMargin + 72.0, y_, quantity.value,
                   {.size = 8.0,
                    .bold = true,
                    .align = quantity.is_number ? TextStyle::Align::kRight : TextStyle::Align::kLeft});
      if (quantity.is_number)
        canvas_.text(kMargin + 75.0, y_,
                     (quantity.plus_minus.empty() ? "" : "± " + quantity.plus_minus + " ") + quantity.unit,
                     {.size = 8.0});
      canvas_.text(kMargin + 124.0, y_, quantity.words, {.size = 7.0, .color = color::kGray});
      y_ += 10.5;
    }
    canvas_.text(kMargin, y_, page_.setup_error_length, {.size = 7.5, .color = color::kGray});
    const double left_end = y_ + 10.0;
    y_ = begin;
    if (page_.display) {
      y_ += canvas_.text(right, y_, page_.display->title, {.size = 8.0, .bold = true, .width = 0.5 * kWidth - kGap});
      for (const Quantity& quantity : page_.display->rows) {
        canvas_.text(right, y_,
                     quantity.is_number
                         ? fmt::format("{} {} {}   {}", quantity.name, quantity.value, quantity.unit, quantity.words)
                         : fmt::format("{} {}", quantity.name, quantity.value),
                     {.size = 8.0});
        y_ += 10.5;
      }
      y_ += 3.0;
    }
    if (!page_.left_over.empty()) {
      y_ += canvas_.text(right, y_, page_.left_over_words, {.size = 8.0, .bold = true, .width = 0.5 * kWidth - kGap});
      constexpr std::size_t kMost = 6;  // all are in the details
      for (std::size_t n = 0; n < std::min(kMost, page_.left_over.size()); ++n) {
        const ReportPage::LeftOver& left = page_.left_over[n];
        canvas_.text(right, y_, left.at, {.size = 8.0, .width = 88.0, .one_line = true});
        canvas_.text(right + 92.0, y_,
                     fmt::format("({}, {}, {}) {}, length {}", left.components[0], left.components[1],
                                 left.components[2], left.unit, left.length),
                     {.size = 7.5});
        y_ += 10.5;
      }
      if (page_.left_over.size() > kMost) {
        canvas_.text(right, y_, fmt::format("and {} more, in the details", page_.left_over.size() - kMost),
                     {.size = 8.0});
        y_ += 10.5;
      }
    }
    y_ = std::max(y_, left_end) + kGap;
  }

  double view_height(const SetupResult::View& view, double width) const {
    return 0.022 * width + 0.2 * width * view.picture.xray.rows / std::max(1, view.picture.xray.columns) + 4.0;
  }

  // The views from `first` on, one below the other as far as they fit above `limit`, narrower if all would fit then.
  // Returns how many are drawn by now.
  std::size_t pictures(std::size_t first, double page_limit, bool may_break_page) {
    constexpr double kNarrowest = 0.6;
    const double limit = page_limit - canvas_.text_height(page_.picture_words, legend_style()) - 2.0;
    const auto all_height = [&](double width) {
      double height = 0.0;
      for (std::size_t n = first; n < report_.views.size(); ++n) height += view_height(report_.views[n], width);
      return height;
    };
    double fitting = kWidth;
    while (fitting > kNarrowest * kWidth && y_ + all_height(fitting) > limit) fitting -= 0.01 * kWidth;
    if (y_ + all_height(fitting) > limit) fitting = kWidth;  // they do not fit either way
    std::size_t n = first;
    for (; n < report_.views.size(); ++n) {
      const double height = view_height(report_.views[n], fitting);
      if (y_ + height > limit + 0.5) {
        if (!may_break_page) break;
        pages_.next_page();
      }
      draw_view(canvas_, kMargin + 0.5 * (kWidth - fitting), y_, fitting, report_.views[n]);
      y_ += height;
    }
    if (n == first) return n;
    const std::string legend =
        fmt::format("{}{}", page_.picture_words, n < report_.views.size() ? " More on the next page." : "");
    y_ += canvas_.text(kMargin, y_, legend, legend_style()) + 2.0;
    return n;
  }

  static TextStyle legend_style() { return {.size = 6.2, .color = color::kGray, .width = kWidth}; }

  static double sign_off_height() { return 82.0; }

  void sign_off() {
    y_ = kBottom - sign_off_height() - conventions_height() - kGap;
    const double begin = y_;
    canvas_.polygon(box(kMargin, begin, kWidth, sign_off_height()), {.color = color::kGray});
    const TextStyle small{.size = 8.0};
    const std::array<double, 5> columns = {6.0, 78.0, 210.0, 300.0, 400.0};
    const std::array<const char*, 5> titles = {"", "Name", "Role", "Date and time", "Signature"};
    for (std::size_t n = 0; n < columns.size(); ++n)
      canvas_.text(kMargin + columns[n], begin + 2.0, titles[n], {.size = 7.0, .color = color::kGray});
    double y = begin + 11.0;
    for (const char* role : {"Matched by", "Reviewed by", "Approved by"}) {
      canvas_.text(kMargin + 6.0, y, role, small);
      canvas_.line({kMargin + 76.0, y + 11.0}, {kMargin + kWidth - 6.0, y + 11.0},
                   {.color = color::kGray, .width = 0.4});
      y += 14.0;
    }
    double x = kMargin + 6.0;
    canvas_.text(x, y, "Decision", small);
    x += 70.0;
    for (const char* choice : {"apply", "image again", "set up again", "override, because"}) {
      canvas_.polygon(box(x, y + 1.0, 7.0, 7.0), {.color = color::kBlack});
      canvas_.text(x + 10.0, y, choice, small);
      x += 22.0 + canvas_.text_width(choice, small);
    }
    canvas_.line({x, y + 10.0}, {kMargin + kWidth - 6.0, y + 10.0}, {.color = color::kGray, .width = 0.4});
    y += 13.5;
    canvas_.text(
        kMargin + 6.0, y,
        "Shift applied   lateral ______  longitudinal ______  vertical ______  yaw ______  pitch ______  roll ______"
        "   verification image ____________",
        {.size = 7.5});
    y_ = begin + sign_off_height() + kGap;
  }

  double conventions_height() {
    double height = 0.0;
    for (const std::string& line : page_.conventions) height += canvas_.text_height(line, conventions_style());
    return height;
  }
  static TextStyle conventions_style() { return {.size = 6.5, .color = color::kGray, .width = kWidth}; }

  void conventions() {
    for (const std::string& line : page_.conventions) y_ += canvas_.text(kMargin, y_, line, conventions_style());
  }

  void list(const std::string& title, const std::vector<std::string>& lines) {
    if (lines.empty()) return;
    pages_.need(30.0);
    y_ += canvas_.text(kMargin, y_, title, {.size = 9.5, .bold = true}) + 1.0;
    for (const std::string& line : lines) pages_.paragraph("· " + line, {.size = 7.5}, 4.0);
    y_ += kGap;
  }

  void section(const ReportPage::Section& section) {
    pages_.need(30.0);
    y_ += canvas_.text(kMargin, y_, section.title, {.size = 9.5, .bold = true}) + 1.0;
    const double names = section.title == kMovedTitle ? 150.0 : 108.0;  // its names are long, and no row may break
    for (const ReportPage::Row& row : section.rows) {
      const TextStyle name{.size = 7.5, .color = color::kGray, .width = names};
      const TextStyle value{.size = 7.5, .width = kWidth - names - 8.0};
      const double height = std::max(canvas_.text_height(row.name, name), canvas_.text_height(row.value, value));
      pages_.need(height);
      canvas_.text(kMargin + 4.0, y_, row.name, name);
      canvas_.text(kMargin + names + 8.0, y_, row.value, value);
      y_ += height + 0.5;
    }
    y_ += kGap;
  }

  void details() {
    list("Reasons for the verdict", page_.reasons);
    if (page_.who.size() > 9) section({.title = "What was registered", .rows = page_.who});
    list("Warnings", page_.warnings);
    list("Overrides: what a person supplied or allowed", page_.overrides);
    for (const ReportPage::Section& each : page_.details) {
      section(each);
      if (each.title == "Search") {
        constexpr double kCurve = 95.0;
        pages_.need(kCurve);
        draw_convergence(canvas_, kMargin + 4.0, y_, kWidth - 8.0, kCurve, report_.stages);
        y_ += kCurve + kGap;
      }
    }
    list("Left aside", page_.left_aside);
  }

  const SetupResult& report_;
  const ReportPage& page_;
  PdfPages pages_;
  Canvas& canvas_ = pages_.canvas();
  double& y_ = pages_.y();
};

}  // namespace

std::string pdf_report(const SetupResult& report, const ReportPage& page) { return PdfReport(report, page).write(); }

}  // namespace isoshift
