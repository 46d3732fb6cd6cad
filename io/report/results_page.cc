#include "io/report/results_page.h"

#include <fmt/format.h>

#include <cmath>

#include "io/report/html.h"
#include "io/report/results.html.h"

namespace isoshift {
namespace {

std::string cell_html(const ResultsPage::Cell& cell) {
  const std::string text = html_escaped(cell.text);
  const std::string sorted_by = cell.number ? fmt::format(" class=\"number\" data-number=\"{}\"", *cell.number) : "";
  if (cell.link.empty()) return fmt::format("<td{}>{}</td>", sorted_by, text);
  return fmt::format("<td{}><a href=\"{}\">{}</a></td>", sorted_by, percent_encoded(cell.link), text);
}

std::string lines_html(const std::vector<std::string>& lines) {
  std::string html;
  for (const std::string& line : lines) html += "<p>" + html_escaped(line) + "</p>\n";
  return html;
}

std::string charts_html(const std::vector<std::string>& charts_svg) {
  std::string html;
  for (const std::string& svg : charts_svg)
    html += fmt::format("<figure><img alt=\"\" src=\"{}\"></figure>\n", data_uri("image/svg+xml", svg));
  return html;
}

std::string section_html(const ResultsPage::Section& section) {
  std::string html = "<h2>" + html_escaped(section.title) + "</h2>\n" + lines_html(section.lines);
  if (!section.columns.empty()) {
    html += "<table>\n<thead><tr>";
    for (const std::string& column : section.columns) html += "<th>" + html_escaped(column) + "</th>";
    html += "</tr></thead>\n<tbody>\n";
    for (const std::vector<ResultsPage::Cell>& row : section.rows) {
      html += "<tr>";
      for (const ResultsPage::Cell& cell : row) html += cell_html(cell);
      html += "</tr>\n";
    }
    html += "</tbody>\n</table>\n";
  }
  return html + charts_html(section.charts_svg) + lines_html(section.remarks);
}

}  // namespace

std::string results_html(const ResultsPage& page) {
  std::string sections, pages, columns, rows;
  for (const ResultsPage::Section& section : page.sections) sections += section_html(section);
  for (const ResultsPage::Cell& other : page.pages)
    pages += fmt::format("<a href=\"{}\">{}</a>\n", percent_encoded(other.link), html_escaped(other.text));
  if (!pages.empty()) pages = "<nav>Other pages: " + pages + "</nav>\n";
  for (const std::string& column : page.columns)
    columns += "<th><button type=\"button\">" + html_escaped(column) + "</button></th>";
  for (const ResultsPage::Row& row : page.rows) {
    rows += "<tr class=\"" + html_escaped(row.verdict) + "\">";
    for (const ResultsPage::Cell& cell : row.cells) rows += cell_html(cell);
    rows += "</tr>\n";
  }
  std::string html = kResultsHtml;
  fill(html, "<!--REFRESH-->",
       page.refresh_s > 0 ? fmt::format("<meta http-equiv=\"refresh\" content=\"{}\">", page.refresh_s) : "");
  fill(html, "<!--TITLE-->", html_escaped(page.title));
  fill(html, "<!--COLUMNS-->", columns);
  fill(html, "<!--SUMMARY-->", lines_html(page.summary));
  fill(html, "<!--CHARTS-->", charts_html(page.charts_svg));
  fill(html, "<!--SECTIONS-->", sections);
  fill(html, "<!--PAGES-->", pages);
  fill(html, "<!--ROWS-->", rows);
  return html;
}

ResultsPage::Cell number_cell(const std::optional<double>& value, int decimals) {
  if (!value) return {.text = ""};
  const double unit = std::pow(10.0, decimals), rounded = std::round(*value * unit) / unit;
  return {.text = fmt::format("{:.{}f}", rounded == 0.0 ? 0.0 : rounded, decimals), .number = value};
}

}  // namespace isoshift
