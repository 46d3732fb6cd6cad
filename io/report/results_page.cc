#include "io/report/results_page.h"

#include <fmt/format.h>

#include "io/report/html.h"
#include "io/report/results.html.h"

namespace isoshift {
namespace {

std::string cell_html(const ResultsPage::Cell& cell) {
  const std::string text = html_escaped(cell.text);
  const std::string sorted_by = cell.number ? fmt::format(" class=\"number\" data-number=\"{}\"", *cell.number) : "";
  if (cell.link.empty()) return fmt::format("<td{}>{}</td>", sorted_by, text);
  return fmt::format("<td{}><a href=\"{}\">{}</a></td>", sorted_by, html_escaped(cell.link), text);
}

}  // namespace

std::string results_html(const ResultsPage& page) {
  std::string summary, charts, pages, columns, rows;
  for (const std::string& line : page.summary) summary += "<p>" + html_escaped(line) + "</p>\n";
  for (const std::string& svg : page.charts_svg)
    charts += fmt::format("<figure><img alt=\"\" src=\"{}\"></figure>\n", data_uri("image/svg+xml", svg));
  for (const ResultsPage::Cell& other : page.pages)
    pages += fmt::format("<a href=\"{}\">{}</a>\n", html_escaped(other.link), html_escaped(other.text));
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
  fill(html, "<!--SUMMARY-->", summary);
  fill(html, "<!--CHARTS-->", charts);
  fill(html, "<!--PAGES-->", pages);
  fill(html, "<!--ROWS-->", rows);
  return html;
}

}  // namespace isoshift
