#include "tools/benchmark/result_table.h"

#include <limits>

#include <gtest/gtest.h>

namespace krot::internal {
namespace {

ResultTable SmallTable() {
  ResultTable table;
  table.name = "small";
  table.caption = "Two models";
  table.columns = {"model", "us"};
  table.rows = {{TextCell("crane"), SizedCell(1.2345)},
                {TextCell("door"), MissingCell()}};
  table.notes = {"A note."};
  return table;
}

TEST(SizedCell, ShowsThreeDigitsOfAnySize) {
  EXPECT_EQ(SizedCell(1234.5).text, "1234");
  EXPECT_EQ(SizedCell(123.45).text, "123");
  EXPECT_EQ(SizedCell(1.2345).text, "1.23");
  EXPECT_EQ(SizedCell(0.0012345).text, "0.00123");
  EXPECT_EQ(SizedCell(0).text, "0");
  EXPECT_EQ(SizedCell(1.2345).value, 1.2345);
}

TEST(SizedCell, IsNullForWhatIsNoNumber) {
  const Cell cell = SizedCell(std::numeric_limits<double>::quiet_NaN());
  EXPECT_TRUE(cell.value.is_null());
  EXPECT_EQ(cell.text, "-");
}

TEST(ResultTable, ReadsAsMarkdown) {
  EXPECT_EQ(ToMarkdown(SmallTable()),
            "Two models:\n\n"
            "| model | us |\n"
            "|---|---:|\n"
            "| crane | 1.23 |\n"
            "| door | n/a |\n"
            "\nA note.\n");
}

TEST(ResultTable, ReadsAsText) {
  EXPECT_EQ(ToText(SmallTable()),
            "Two models\n"
            "  model    us\n"
            "  crane  1.23\n"
            "  door    n/a\n"
            "  A note.\n");
}

TEST(ResultTable, KeepsItsNumbersInJson) {
  const auto json = ToJson(SmallTable());
  EXPECT_EQ(json["name"], "small");
  EXPECT_EQ(json["rows"][0]["us"], 1.2345);
  EXPECT_TRUE(json["rows"][1]["us"].is_null());
}

TEST(ResultTable, FoldsUpDetailsInMarkdown) {
  ResultTable table;
  table.caption = "Costs";
  table.columns = {"model"};
  table.rows = {{TextCell("tower")}};
  table.is_detail = true;
  EXPECT_EQ(ToMarkdown(table),
            "<details><summary>Costs</summary>\n\n| model |\n|---|\n"
            "| tower |\n\n</details>\n");
}

}  // namespace
}  // namespace krot::internal
