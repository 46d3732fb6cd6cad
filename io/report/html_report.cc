#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "io/report/drawings.h"
#include "io/report/formats.h"
#include "io/report/html.h"
#include "io/report/moved_bodies.h"
#include "io/report/page.html.h"
#include "io/report/polygons_json.h"

namespace isoshift {
namespace {

std::string list(const std::vector<std::string>& lines) {
  if (lines.empty()) return "";
  std::string html = "<ul>";
  for (const std::string& line : lines) html += "<li>" + html_escaped(line) + "</li>";
  return html + "</ul>";
}

std::string rows(const std::vector<ReportPage::Row>& list_of_rows) {
  std::string html;
  for (const ReportPage::Row& row : list_of_rows)
    html += fmt::format("<tr{}><th>{}</th><td>{}</td></tr>",
                        row.name == "Patient" ? " class=\"patient\""
                        : row.name == kBent   ? " class=\"bent\""
                                              : "",
                        html_escaped(row.name), html_escaped(row.value));
  return html;
}

// Numbers with id's such as couch-lateral, for whoever wants to find them.
std::string quantities(const std::vector<Quantity>& list_of_quantities, const std::string& id, bool is_couch) {
  std::string html = "<table id=\"" + id + "\">";
  for (std::size_t n = 0; n < list_of_quantities.size(); ++n) {
    const Quantity& quantity = list_of_quantities[n];
    html += fmt::format(
        "<tr{}><th>{}</th><td class=\"value\">{}</td><td class=\"unit\">{}{}</td><td class=\"words\">{}</td></tr>",
        is_couch && n < 3 ? " class=\"translation\"" : "", html_escaped(quantity.name), html_escaped(quantity.value),
        quantity.is_number && !quantity.plus_minus.empty() && !is_couch ? "± " + quantity.plus_minus + " " : "",
        quantity.is_number ? quantity.unit : "", html_escaped(quantity.words));
  }
  return html + "</table>";
}

std::string couch(const ReportPage& page) {
  if (page.withheld)
    return "<p class=\"withheld\">withheld</p><p>The result was rejected: there is no shift to apply.</p>";
  return quantities(page.couch, "couch", true) +
         fmt::format("<p class=\"dim\">{}. {}</p>", html_escaped(page.couch_order), html_escaped(page.couch_target));
}

std::string numbers(const ReportPage& page) {
  if (page.withheld) return "";
  std::string html = "<div><h2>Setup error: where the patient lies</h2>" +
                     quantities(page.setup_error, "setup-error", false) +
                     fmt::format("<p class=\"dim\">{}</p></div>", html_escaped(page.setup_error_length));
  if (page.display)
    html += fmt::format("<div><h2>{}</h2>{}</div>", html_escaped(page.display->title),
                        quantities(page.display->rows, "display", false));
  if (!page.left_over.empty()) {
    html += fmt::format("<div><h2>{}</h2><table id=\"left-over\">", html_escaped(page.left_over_words));
    for (const ReportPage::LeftOver& left : page.left_over)
      html +=
          fmt::format("<tr><th>{}</th><td>({}, {}, {}) {}</td><td>length {} {}</td></tr>", html_escaped(left.at),
                      left.components[0], left.components[1], left.components[2], left.unit, left.length, left.unit);
    html += "</table></div>";
  }
  return html;
}

std::string svg_image(double width, double height, std::string_view description,
                      const std::function<void(Canvas&)>& draw) {
  Canvas canvas(Canvas::Kind::kSvg, width, height);
  draw(canvas);
  return fmt::format("<img alt=\"{}\" width=\"{:.0f}\" height=\"{:.0f}\" src=\"{}\">", description, 1.4 * width,
                     1.4 * height, data_uri("image/svg+xml", canvas.finish()));
}

std::string png_image(const std::string& png, std::string_view name, std::string_view description) {
  return fmt::format("<img class=\"{}\" alt=\"{}\" src=\"{}\">", name, description, data_uri("image/png", png));
}

std::string view_figure(const SetupResult::View& view, const ViewPngs& pictures, std::size_t number) {
  const auto radio = [&](const char* group, const char* value, const char* words, bool checked) {
    return fmt::format("<label><input type=\"radio\" name=\"{}{}\" value=\"{}\"{}> {}</label>", group, number, value,
                       checked ? " checked" : "", words);
  };
  return fmt::format("<figure id=\"view{}\"><figcaption>{}</figcaption><div class=\"stills\">", number,
                     html_escaped(printable(view.label))) +
         png_image(pictures.xray, "xray", "X-ray") +
         png_image(pictures.drr_planned, "planned", "DRR, patient as planned") +
         png_image(pictures.drr_found, "found", "DRR, patient as found") +
         "</div><div class=\"controls\" hidden>"
         "<label>Wipe<input type=\"range\" min=\"0\" max=\"100\" value=\"50\">"
         "<span class=\"ends\"><span>DRR</span><span>X-ray</span></span></label>"
         "<fieldset><legend>Show</legend>" +
         radio("mode", "wipe", "wipe", true) + radio("mode", "both", "both in color", false) +
         radio("mode", "difference", "difference", false) + "</fieldset><fieldset><legend>Patient</legend>" +
         radio("patient", "planned", "before (as planned)", false) +
         radio("patient", "found", "after (as found)", true) +
         "<label><input type=\"checkbox\" name=\"marks\" checked> marks</label></fieldset></div></figure>";
}

using Json = nlohmann::ordered_json;

Json view_data(const SetupResult::View& view, std::size_t number) {
  Json structures = Json::array();
  for (const ViewPicture::Outline& outline : view.picture.structures)
    structures.push_back({{"name", printable(outline.name)},
                          {"planned", polygons_json(outline.planned)},
                          {"found", polygons_json(outline.found)}});
  const MismatchMarks marks = mismatch_marks(view);
  return {{"number", number},
          {"label", printable(view.label)},
          {"isocenter", {view.picture.isocenter_px.x(), view.picture.isocenter_px.y()}},
          {"pixels_per_mm", view.picture.pixels_per_mm},
          {"directions", view.picture.directions},
          {"field", polygons_json(view.picture.field)},
          {"is_field_sure", view.match.field.is_sure()},
          {"structures", structures},
          {"moved", polygons_json(view.picture.moved)},
          {"squares", polygons_json(marks.squares)},
          {"ways", polygons_json(marks.ways)}};
}

// JSON inside a script element: no text can end the element.
std::string in_script(const Json& json) {
  std::string result;
  for (const char c : json.dump(-1, ' ', true, Json::error_handler_t::replace))
    result += c == '<' ? std::string("\\u003c") : std::string(1, c);
  return result;
}

std::string details(const SetupResult& report, const ReportPage& page) {
  std::string html;
  for (const ReportPage::Section& section : page.details) {
    html += fmt::format("<details{}><summary>{}</summary><table>{}</table>",
                        section.title == kMovedTitle ? " open" : "", html_escaped(section.title), rows(section.rows));
    if (section.title == "Search")
      html += svg_image(520, 110, "The similarity reached against the evaluations made",
                        [&](Canvas& canvas) { draw_convergence(canvas, 0, 0, 520, 110, report.stages); });
    html += "</details>";
  }
  if (!page.left_aside.empty()) html += "<details><summary>Left aside</summary>" + list(page.left_aside) + "</details>";
  return html;
}

}  // namespace

std::string html_report(const SetupResult& report, const ReportPage& page, std::span<const ViewPngs> pictures) {
  std::string views, notes, conventions;
  Json data = Json::array();
  for (std::size_t n = 0; n < report.views.size(); ++n) {
    views += view_figure(report.views[n], pictures[n], n + 1);
    data.push_back(view_data(report.views[n], n + 1));
  }
  if (!page.warnings.empty()) notes += "<h2>Warnings</h2>" + list(page.warnings);
  if (!page.overrides.empty()) notes += "<h2>Overrides: what a person supplied or allowed</h2>" + list(page.overrides);
  for (const std::string& line : page.conventions) conventions += "<p>" + html_escaped(line) + "</p>";

  // All text is escaped: none of it can look like a placeholder.
  std::string html = kPageHtml;
  fill(html, "<!--DISCLAIMER-->", html_escaped(page.disclaimer));
  fill(html, "<!--TITLE-->", html_escaped(page.title));
  fill(html, "<!--PROGRAM-->", html_escaped(page.program));
  fill(html, "<!--VERDICT_CLASS-->", std::string(to_string(page.verdict)));
  fill(html, "<!--COUCH_DRAWING-->",
       svg_image(260, 180, "The couch, its axes and the way it has to move",
                 [&](Canvas& canvas) { draw_couch(canvas, 0, 0, 260, 180, report, page); }));
  fill(html, "<!--PICTURES-->", html_escaped(page.picture_words));
  fill(html, "<!--CONVENTIONS-->", conventions);
  fill(html, "<!--COUCH-->", couch(page));
  fill(html, "<!--NUMBERS-->", numbers(page));
  fill(html, "<!--VIEW_DATA-->", in_script(data));
  fill(html, "<!--VERDICT-->", html_escaped(page.verdict_words));
  fill(html, "<!--REASONS-->", list(page.reasons));
  fill(html, "<!--ACTION-->", html_escaped(page.action_words) + list(page.action_reasons));
  fill(html, "<!--DETAILS-->", details(report, page));
  fill(html, "<!--NOTES-->", notes);
  fill(html, "<!--VIEWS-->", views);
  fill(html, "<!--WHO-->", rows(page.who));
  return html;
}

}  // namespace isoshift
