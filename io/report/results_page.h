#pragma once
// An HTML page of many results: charts, and a table that can be sorted and filtered and that links the reports. The
// page needs no other file and no network.

#include <optional>
#include <string>
#include <vector>

namespace isoshift {

struct ResultsPage {
  struct Cell {
    std::string text;
    std::optional<double> number;  // the key for sorting; unset: the text
    std::string link;              // relative to the page; empty: none
  };
  struct Row {
    std::string verdict;  // determines the color: "accepted", "review", "rejected", or another state
    std::vector<Cell> cells;
  };

  // A part of the page above the table of results, with a heading of its own.
  struct Section {
    std::string title;
    std::vector<std::string> lines;
    std::vector<std::string> columns;
    std::vector<std::vector<Cell>> rows;
    std::vector<std::string> charts_svg;
    std::vector<std::string> remarks;  // below the charts
  };

  std::string title;
  std::vector<std::string> summary;     // lines above everything else
  std::vector<std::string> charts_svg;  // below the summary
  std::vector<Section> sections;
  std::vector<std::string> columns;
  std::vector<Row> rows;
  std::vector<Cell> pages;  // links to other pages like this one
  int refresh_s = 0;        // the browser reloads the page after this time; 0: never
};

std::string results_html(const ResultsPage& page);

// A rounded number that is sorted by its value; without a number an empty cell.
ResultsPage::Cell number_cell(const std::optional<double>& value, int decimals);

}  // namespace isoshift
