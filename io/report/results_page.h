#pragma once
// An HTML page of many results: a table that sorts and filters and links each report, with charts above it. It needs no
// other file and no network.

#include <optional>
#include <string>
#include <vector>

namespace isoshift {

struct ResultsPage {
  struct Cell {
    std::string text;
    std::optional<double> number;  // what it sorts by; unset: the text
    std::string link;              // relative to the page; empty: none
  };
  struct Row {
    std::string verdict;  // "accepted", "review", "rejected", or what else became of it: a color
    std::vector<Cell> cells;
  };

  std::string title;
  std::vector<std::string> summary;     // lines above the table
  std::vector<std::string> charts_svg;  // below them
  std::vector<std::string> columns;
  std::vector<Row> rows;
  std::vector<Cell> pages;  // others like this one
  int refresh_s = 0;        // reload after so long; 0: never
};

std::string results_html(const ResultsPage& page);

}  // namespace isoshift
