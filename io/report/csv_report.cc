#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "base/csv.h"
#include "io/report/canvas.h"
#include "io/report/formats.h"

namespace isoshift {
namespace {

// A number as every program reads it: without the plus sign; empty where there is none.
std::string number(const Quantity& quantity) {
  if (!quantity.is_number) return "";
  return quantity.value.starts_with('+') ? quantity.value.substr(1) : quantity.value;
}

std::string list_of(const std::vector<std::string>& texts) { return fmt::format("{}", fmt::join(texts, "; ")); }

}  // namespace

std::string csv_report(const SetupResult& report) {
  SetupResult in_mm = report;
  if (in_mm.site) in_mm.site->length_unit = LengthUnit::kMm;
  const ReportPage page = report_page(in_mm);

  std::vector<std::string> names, cells;
  const auto add = [&](std::string name, std::string value) {
    names.push_back(std::move(name));
    cells.push_back(std::move(value));
  };
  add("made_on", csv_cell(report.made_on));
  add("patient_id", csv_cell(printable(report.identity.patient_id)));
  add("patient_name", csv_cell(name_for_people(report.identity.patient_name)));
  add("plan", csv_cell(printable(report.plan_label)));
  add("plan_uid", csv_cell(report.plan_uid));
  std::vector<std::string> views;
  for (const SetupResult::View& view : report.views) views.push_back(printable(view.label));
  add("views", csv_cell(list_of(views)));
  add("verdict", std::string(to_string(page.verdict)));
  add("reasons", csv_cell(list_of(page.reasons)));
  add("action", std::string(to_string(page.action)));
  add("action_reasons", csv_cell(list_of(page.action_reasons)));
  const auto add_numbers = [&](const std::vector<Quantity>& quantities, const std::vector<std::string>& columns) {
    for (std::size_t n = 0; n < columns.size(); ++n) {
      add(columns[n], n < quantities.size() ? number(quantities[n]) : "");
      if (columns[n].starts_with("error"))
        add("two_sigma_" + columns[n], n < quantities.size() ? quantities[n].plus_minus : "");
    }
  };
  add_numbers(page.couch, {"lateral_mm", "longitudinal_mm", "vertical_mm", "yaw_deg", "pitch_deg", "roll_deg"});
  add_numbers(page.setup_error, {"error_x_mm", "error_y_mm", "error_z_mm", "error_about_x_deg", "error_about_y_deg",
                                 "error_about_z_deg"});
  add("overrides", fmt::format("{}", page.overrides.size()));
  add("warnings", fmt::format("{}", page.warnings.size()));
  add("spatial_registration_uid", csv_cell(report.spatial_registration_uid));
  return fmt::format("{}\r\n{}\r\n", fmt::join(names, ","), fmt::join(cells, ","));
}

}  // namespace isoshift
