#include "io/report/formats.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace isoshift {
namespace {

// "  Lateral          -4.3 +/- 0.1 mm   to the left, seen facing the gantry".
std::string line(const Quantity& quantity) {
  const std::string uncertain = quantity.plus_minus.empty() ? "" : " +/- " + quantity.plus_minus;
  const std::string text = quantity.is_number ? fmt::format("  {:<14} {:>6}{} {:<4} {}", quantity.name, quantity.value,
                                                            uncertain, quantity.unit, quantity.words)
                                              : fmt::format("  {:<14} {}{}", quantity.name, quantity.value,
                                                            quantity.words.empty() ? "" : ": " + quantity.words);
  return text.substr(0, text.find_last_not_of(' ') + 1) + "\n";
}

std::string lines(const std::vector<Quantity>& quantities) {
  std::string text;
  for (const Quantity& quantity : quantities) text += line(quantity);
  return text;
}

std::string list(std::string_view title, const std::vector<std::string>& items) {
  if (items.empty()) return "";
  return fmt::format("\n{}\n  - {}\n", title, fmt::join(items, "\n  - "));
}

std::string reasons(const std::vector<std::string>& items) {
  return items.empty() ? "" : fmt::format("  - {}\n", fmt::join(items, "\n  - "));
}

std::string shift(const ReportPage& page) {
  if (page.withheld)
    return "\nMOVE THE COUCH BY\n  withheld: the result was rejected\n"
           "\nSETUP ERROR\n  withheld: the result was rejected\n";
  std::string text =
      fmt::format("\nMOVE THE COUCH BY   ({})\n{}  {}\n", page.couch_order, lines(page.couch), page.couch_target);
  if (page.display) text += fmt::format("\n  {}\n{}", page.display->title, lines(page.display->rows));
  text += fmt::format("\nSETUP ERROR         (where the patient lies, against the plan)\n{}", lines(page.setup_error));
  if (!page.setup_error_length.empty()) text += fmt::format("  {}\n", page.setup_error_length);
  return text;
}

}  // namespace

std::string text_report(const ReportPage& page) {
  std::string text = fmt::format("{:<52}  {}\n{}\n\n", upper_case(page.title), page.program, page.disclaimer);
  for (const ReportPage::Row& row : page.who) text += fmt::format("{:<12} {}\n", row.name, row.value);
  text += fmt::format("\nVERDICT      {}\n{}", page.verdict_words, reasons(page.reasons));
  text += fmt::format("ACTION       {}\n{}", page.action_words, reasons(page.action_reasons));
  text += shift(page);
  text += list("WARNINGS", page.warnings) + list("OVERRIDES", page.overrides);
  text += list("CONVENTIONS", page.conventions);
  for (const ReportPage::Section& section : page.details) {
    text += fmt::format("\n{}\n", upper_case(section.title));
    std::size_t width = 24;
    for (const ReportPage::Row& row : section.rows)
      if (row.name.size() <= 36) width = std::max(width, row.name.size());
    for (const ReportPage::Row& row : section.rows) text += fmt::format("  {:<{}} {}\n", row.name, width, row.value);
  }
  return text;
}

}  // namespace isoshift
