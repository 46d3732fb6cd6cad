#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "base/version.h"
#include "io/report/pdf_pages.h"
#include "workflow/commission/commission_files.h"

namespace isoshift {
namespace {

Rgb color_of(Outcome outcome) {
  switch (outcome) {
    case Outcome::kPassed: return color::kBlue;
    case Outcome::kFailed: return color::kVermilion;
    case Outcome::kUntested: return color::kOrange;
  }
  return color::kBlack;
}

class CommissionPdf {
 public:
  CommissionPdf(const Commission& commission, bool is_signed_by_key)
      : commission_(commission), words_(words_of(commission)), is_signed_by_key_(is_signed_by_key) {}

  std::string write() {
    header();
    table();
    chart();
    pages_.list("Uncertainty", {words_.sigma});
    pages_.list("Tested", words_.tested);
    pages_.list("Not tested", words_.untested);
    signature();
    sessions();
    return pages_.finish();
  }

 private:
  static constexpr double kMargin = PdfPages::kMargin, kWidth = PdfPages::kWidth, kText = PdfPages::kText;

  static std::string program() { return fmt::format("isoshift {} ({})", kVersion, kCommit); }

  void header() {
    canvas_.text(kMargin + kWidth, y_ + 4.0, program(),
                 {.size = 8.0, .color = color::kGray, .align = TextStyle::Align::kRight});
    y_ += canvas_.text(kMargin, y_, words_.title, {.size = 17.0, .bold = true}) + 8.0;
    const double begin = y_;
    y_ += 4.0;
    y_ += canvas_.text(kMargin + 12.0, y_, words_.outcome, {.size = 12.0, .bold = true}) + 4.0;
    pages_.bar(begin, color_of(commission_.outcome()));
    y_ += 6.0;
    pages_.paragraph(fmt::format("Made on {}. {} sessions used, {} left out. What is known comes from {}.",
                                 commission_.made_on, commission_.sessions.size(), commission_.left_out.size(),
                                 words_.known_from));
    if (commission_.limits)
      pages_.paragraph(fmt::format("Limits of {} (site file {}): {:g} mm along and {:g} degrees about any axis.",
                                   commission_.site_name, commission_.site_sha256.substr(0, 12),
                                   commission_.limits->translation_mm, commission_.limits->rotation_deg));
    else
      pages_.paragraph("No limits: there was no site file.");
  }

  void table() {
    pages_.heading("Errors: found against known, IEC 61217 fixed");
    constexpr std::array kLeft = {0.0, 150.0, 180.0, 250.0, 330.0, 370.0, 415.0, 470.0};
    constexpr std::array kNames = {"axis", "n", "known from, to", "bias ± 95 %", "SD", "largest", "polarity", "limit"};
    const auto cell = [&](std::size_t column, const std::string& text, const TextStyle& style = {.size = kText}) {
      canvas_.text(kMargin + kLeft[column], y_, text, style);
    };
    for (std::size_t n = 0; n < kNames.size(); ++n) cell(n, kNames[n], {.size = 8.0, .color = color::kGray});
    y_ += 12.0;
    for (std::size_t n = 0; n < words_.axes.size(); ++n) {
      const AxisOfLocalization& axis = commission_.localization.axes[n];
      const char* unit = n < 3 ? "mm" : "°";
      cell(0, fmt::format("{}, {}", words_.axes[n], unit));
      if (axis.errors) {
        const Agreement& errors = *axis.errors;
        cell(1, fmt::format("{}", errors.count));
        cell(2, fmt::format("{:+.2f}, {:+.2f}", axis.least_known.value(), axis.most_known.value()));
        cell(3, errors.bias_within ? fmt::format("{:+.3f} ± {:.3f}", errors.bias, *errors.bias_within)
                                   : fmt::format("{:+.3f}", errors.bias));
        cell(4, errors.sd ? fmt::format("{:.3f}", *errors.sd) : "-");
        cell(5, fmt::format("{:.3f}", axis.largest));
      } else {
        cell(2, kNoErrors);
      }
      outcome(kLeft[6], commission_.localization.polarity(n));
      outcome(kLeft[7], axis.limit);
      y_ += 12.0;
    }
  }

  void outcome(double x, Outcome outcome) {
    canvas_.text(kMargin + x, y_, std::string(to_string(outcome)),
                 {.size = kText, .bold = outcome == Outcome::kFailed, .color = color_of(outcome)});
  }

  // Every error as a dot with two sigma, an axis per strip, the site's limits dashed.
  void chart() {
    constexpr double kStrip = 26.0, kLabel = 110.0;
    pages_.heading("Every error with two sigma; dashed: the site's limits");
    for (std::size_t n = 0; n < words_.axes.size(); ++n) {
      const AxisOfLocalization& axis = commission_.localization.axes[n];
      if (!axis.errors) continue;
      pages_.need(kStrip);
      const double limit = !commission_.limits ? 0.0
                           : n < 3             ? commission_.limits->translation_mm
                                               : commission_.limits->rotation_deg;
      double most = std::max(axis.largest, limit);
      for (const Localized& one : commission_.localization.all)
        if (one.error[n]) most = std::max(most, std::abs(*one.error[n]) + 2.0 * one.sigma[n].value_or(0.0));
      const double reach = std::max(1.1 * most, 1e-3), left = kMargin + kLabel, width = kWidth - kLabel;
      const double middle = y_ + 0.5 * kStrip;
      const auto x_of = [&](double value) { return left + width * (0.5 + 0.5 * value / reach); };
      canvas_.fill(left, y_, width, kStrip - 2.0, color::kPaleGray);
      canvas_.text(kMargin, middle - 10.0, words_.axes[n], {.size = kText});
      canvas_.text(kMargin, middle, fmt::format("±{:.2f} {}", reach, n < 3 ? "mm" : "°"),
                   {.size = 7.0, .color = color::kGray});
      canvas_.line({x_of(0.0), y_}, {x_of(0.0), y_ + kStrip - 2.0}, {.color = color::kGray});
      if (limit > 0.0)
        for (const double side : {-limit, limit})
          canvas_.line({x_of(side), y_}, {x_of(side), y_ + kStrip - 2.0}, {.color = color::kVermilion, .dashed = true});
      const double step = (kStrip - 8.0) / static_cast<double>(commission_.localization.all.size());
      double y = y_ + 3.0 + 0.5 * step;
      for (const Localized& one : commission_.localization.all) {
        if (one.error[n]) {
          const double two_sigma = 2.0 * one.sigma[n].value_or(0.0);
          canvas_.line({x_of(*one.error[n] - two_sigma), y}, {x_of(*one.error[n] + two_sigma), y},
                       {.color = color::kSkyBlue});
          canvas_.circle({x_of(*one.error[n]), y}, 1.4, {.color = color::kBlue, .width = 1.2});
        }
        y += step;
      }
      y_ += kStrip;
    }
  }

  void signature() {
    pages_.need(56.0);
    y_ += 14.0;
    if (!commission_.by.empty())
      pages_.paragraph(is_signed_by_key_
                           ? fmt::format("Signed by {} with a key: commission.json.sig signs commission.json, "
                                         "which holds the hash of this file.",
                                         commission_.by)
                           : fmt::format("Made by {}.", commission_.by));
    y_ += 26.0;
    const double half = 0.5 * kWidth - 10.0;
    for (const auto& [x, words] :
         {std::pair(kMargin, "Physicist, date"), std::pair(kMargin + half + 20.0, "Reviewed by, date")}) {
      canvas_.line({x, y_}, {x + half, y_}, {});
      canvas_.text(x, y_ + 2.0, words, {.size = 7.5, .color = color::kGray});
    }
    y_ += 14.0;
  }

  void sessions() {
    std::vector<std::string> lines;
    lines.reserve(commission_.sessions.size() + commission_.left_out.size());
    for (const NamedResult& session : commission_.sessions)
      lines.push_back(fmt::format("{}  ·  {}  ·  {}{}{}", session.name, session.acquired(),
                                  to_string(session.result.verdict()), session.result.reasons().empty() ? "" : "; ",
                                  fmt::join(session.result.reasons(), "; ")));
    for (const Commission::LeftOut& left : commission_.left_out)
      lines.push_back(fmt::format("left out: {}: {}", left.session, left.why));
    pages_.list("Sessions", lines);
  }

  const Commission& commission_;
  CommissionWords words_;
  bool is_signed_by_key_;
  PdfPages pages_{words_.title, program(), program()};
  Canvas& canvas_ = pages_.canvas();
  double& y_ = pages_.y();
};

}  // namespace

std::string commission_pdf(const Commission& commission, bool is_signed_by_key) {
  return CommissionPdf(commission, is_signed_by_key).write();
}

}  // namespace isoshift
