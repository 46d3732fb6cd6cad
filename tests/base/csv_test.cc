#include "base/csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"

namespace isoshift::csv_test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// However lines end, they are counted as an editor counts them, also those within a cell and empty ones.
TEST(Csv, RowsAreWhereAnEditorShowsThem) {
  for (const std::string end : {"\n", "\r\n", "\r"}) {
    const CsvTable table =
        csv_table("a,b" + end + "1,2" + end + end + "\"x" + end + "y\",3" + end + "4,5" + end, "here");
    EXPECT_THAT(table.columns, ElementsAre("a", "b"));
    ASSERT_EQ(table.rows.size(), 3U);
    EXPECT_EQ(table.rows[0].line, 2);
    EXPECT_EQ(table.rows[1].line, 4);
    EXPECT_EQ(table.rows[1].cells.front(), "x" + end + "y");
    EXPECT_EQ(table.rows[2].line, 6);
  }
}

TEST(Csv, MistakesNameTheirLine) {
  const auto refusal = [](const std::string& text) {
    try {
      csv_table(text, "here.csv");
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("not refused");
  };
  EXPECT_THAT(refusal("a,b\r\n1,2\r\n1,2,3\r\n"), HasSubstr("here.csv, line 3: 3 cells, expected 2"));
  EXPECT_THAT(refusal("a,b\r\n1,2\r\n\"1,2\r\n"), HasSubstr("here.csv, line 3: "));
}

// As spreadsheets write them behind a table, and below it.
TEST(Csv, ColumnsAndRowsWithoutAnythingInThemDoNotCount) {
  const CsvTable table = csv_table("a,b,,\n1,2,,\n,,,\n3,,,\n", "here");
  EXPECT_THAT(table.columns, ElementsAre("a", "b"));
  ASSERT_EQ(table.rows.size(), 2U);
  EXPECT_THAT(table.rows[1].cells, ElementsAre("3", ""));
  EXPECT_EQ(table.rows[1].line, 4);
  EXPECT_EQ(csv_table("a,b,,\n1,2,,3\n", "here").columns.size(), 4U) << "something is in one of them";
}

TEST(Csv, NumbersAreReadAsPeopleWriteThem) {
  EXPECT_EQ(number_in_cell(" +3.25\t"), 3.25);
  EXPECT_EQ(number_in_cell("-0.5"), -0.5);
  for (const char* none : {"", " ", "1,5", "1.5 mm", "nan", "inf", "+-1", "++1", "1e999"})
    EXPECT_FALSE(number_in_cell(none)) << none;
}

}  // namespace
}  // namespace isoshift::csv_test
