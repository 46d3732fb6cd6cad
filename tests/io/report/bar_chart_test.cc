#include "io/report/bar_chart.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <regex>

#include "tests/support/command.h"
#include "tests/support/temporary_folder.h"

namespace isoshift::bar_chart_test {
namespace {

using testing::HasSubstr;

BarChart some_chart() {
  return {.title = "Success of 12 starts",
          .x_label = "mTRE at the start [mm]",
          .y_label = "success [%]",
          .bars = {{0.0, 1.0, 100.0}, {1.0, 2.0, 50.0}, {4.0, 5.0, 0.0}},
          .y_max = 100.0,
          .reference_line = 95.0};
}

// Without the numbers that Cairo gives to the surfaces of a process.
std::string written(const BarChart& chart) {
  return std::regex_replace(bar_chart_svg(chart), std::regex("id=\"surface[0-9]+\""), "");
}

// Text is drawn as outlines, a character each.
std::ptrdiff_t characters_in(const std::string& svg) {
  const std::regex use("<use ");
  return std::distance(std::sregex_iterator(svg.begin(), svg.end(), use), std::sregex_iterator());
}

// Whether an XML parser reads it, and of which element it is.
std::string root_element(const std::filesystem::path& path) {
  const CommandOutcome parsed = run_shell(fmt::format(
      "/usr/bin/python3 -c \"import xml.etree.ElementTree as t; print(t.parse('{}').getroot().tag)\"", path.string()));
  return parsed.out;
}

TEST(BarChart, IsWellFormedSvg) {
  const TemporaryFolder folder;
  std::ofstream(folder / "chart.svg") << bar_chart_svg(some_chart());
  EXPECT_EQ(root_element(folder / "chart.svg"), "{http://www.w3.org/2000/svg}svg\n");
}

TEST(BarChart, SameChartSameFile) { EXPECT_EQ(written(some_chart()), written(some_chart())); }

TEST(BarChart, HasItsTitleAndLabels) {
  BarChart bare = some_chart();
  bare.title = bare.x_label = bare.y_label = "";
  const std::ptrdiff_t of_ticks = characters_in(written(bare));
  EXPECT_GT(of_ticks, 10);
  for (const auto& [part, text] : {std::pair(&BarChart::title, some_chart().title),
                                   {&BarChart::x_label, some_chart().x_label},
                                   {&BarChart::y_label, some_chart().y_label}}) {
    BarChart chart = bare;
    chart.*part = text;
    EXPECT_EQ(characters_in(written(chart)) - of_ticks, static_cast<std::ptrdiff_t>(text.size())) << text;
  }
}

TEST(BarChart, EveryPartIsDrawn) {
  const std::string as_is = written(some_chart());
  const auto changed = [](auto&& change) {
    BarChart chart = some_chart();
    change(chart);
    return written(chart);
  };
  EXPECT_NE(changed([](BarChart& chart) { chart.bars[1].height = 60.0; }), as_is);
  EXPECT_NE(changed([](BarChart& chart) { chart.bars[2].to = 6.0; }), as_is);
  EXPECT_NE(changed([](BarChart& chart) { chart.reference_line.reset(); }), as_is);
  // Without an upper end given, the highest bar is it.
  EXPECT_NE(changed([](BarChart& chart) { chart.y_max.reset(), chart.bars[0].height = 40.0; }), as_is);
  EXPECT_EQ(changed([](BarChart& chart) { chart.y_max.reset(); }), as_is);
}

TEST(BarChart, BarsOfNothingAreDrawnToo) {
  EXPECT_THAT(written({.title = "none", .x_label = "x", .y_label = "y", .bars = {{0.0, 1.0, 0.0}}}), HasSubstr("<svg"));
}

}  // namespace
}  // namespace isoshift::bar_chart_test
