#include "io/report/scatter_chart.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <regex>
#include <string>
#include <vector>

#include "io/report/html.h"
#include "io/report/results_page.h"

namespace isoshift::scatter_chart_test {
namespace {

// How high the dots of a chart lie, in points from its upper edge.
std::vector<double> heights_of_dots(const std::string& svg) {
  const std::regex circle(R"re(<path [^>]*stroke-width[:=]"?1[;"][^>]* d="M ([0-9.]+) ([0-9.]+) C)re");
  std::vector<double> heights;
  for (std::sregex_iterator dot(svg.begin(), svg.end(), circle), end; dot != end; ++dot)
    heights.push_back(std::stod((*dot)[2]));
  return heights;
}

double spread_of_dots(const ScatterChart::Points& marked) {
  ScatterChart chart{.title = "lateral", .marked = marked};
  for (int n = 0; n <= 20; ++n) chart.points.emplace_back(n, n % 2 == 0 ? -1.0 : 1.0);
  const std::vector<double> heights = heights_of_dots(scatter_chart_svg(chart, 318.0, 205.0));
  EXPECT_EQ(heights.size(), 21U);
  if (heights.empty()) return 0.0;
  const auto [least, most] = std::ranges::minmax(heights);
  return most - least;
}

TEST(ScatterChart, AFarOutlierDoesNotPressTheOthersIntoALine) {
  const double alone = spread_of_dots({});
  EXPECT_GT(alone, 100.0);
  EXPECT_LT(spread_of_dots({{5.0, 1.8}}), alone) << "one that is near is drawn where it lies";
  EXPECT_GT(spread_of_dots({{5.0, 800.0}}), 0.6 * alone);
  EXPECT_GT(spread_of_dots({{5.0, 800.0}, {6.0, -900.0}, {7.0, 1000.0}}), 0.45 * alone);
}

TEST(PercentEncoded, NamesStayNamesInLinks) {
  EXPECT_EQ(percent_encoded("../results/p1_f-2.a~b/report.html"), "../results/p1_f-2.a~b/report.html");
  EXPECT_EQ(percent_encoded("M\xC3\xBCller #1? 50%/a:b\"<>&'.html"),
            "M%C3%BCller%20%231%3F%2050%25/a%3Ab%22%3C%3E%26%27.html");
  const ResultsPage page{
      .rows = {{.verdict = "accepted", .cells = {{.text = "day #2", .link = "day #2/report.html"}}}}};
  EXPECT_NE(results_html(page).find("<a href=\"day%20%232/report.html\">day #2</a>"), std::string::npos);
}

}  // namespace
}  // namespace isoshift::scatter_chart_test
