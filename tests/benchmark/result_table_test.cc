#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tools/benchmark/log_plot.h"
#include "tools/benchmark/result_table.h"
#include "tools/benchmark/summary.h"

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

using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;

TEST(LogPlot, HoldsItsDataAndNames) {
  LogPlot plot;
  plot.title = "a's < b";
  plot.series = {{"ours", {{1, 2.5}, {10, 3}}}};
  const std::string script = ToGnuplot(plot);
  EXPECT_THAT(script, HasSubstr("set title 'a''s < b'\n"));
  EXPECT_THAT(script, HasSubstr("<< EOD\n1 2.5\n10 3\nEOD\n"));
  EXPECT_THAT(script, HasSubstr("title 'ours'"));
}

TEST(LogPlot, LeavesOutWhatHasNoLogarithm) {
  LogPlot plot;
  plot.series = {{"ours", {{1, 1}, {2, 0}, {3, 5}}}, {"none", {{1, 0}}}};
  const std::string script = ToGnuplot(plot);
  EXPECT_THAT(script, HasSubstr("<< EOD\n1 1\n3 5\nEOD\n"));
  EXPECT_THAT(script, Not(HasSubstr("none")));
}

// Gnuplot has eight colours.
TEST(LogPlot, TellsTheNinthLineFromTheFirst) {
  LogPlot plot;
  for (int k = 0; k < 9; ++k) {
    plot.series.push_back({"line " + std::to_string(k), {{1, 1.0 + k}}});
  }
  const std::string script = ToGnuplot(plot);
  EXPECT_THAT(script, ContainsRegex("dashtype 1 [^\n]*'line 0'"));
  EXPECT_THAT(script, ContainsRegex("dashtype 1 [^\n]*'line 7'"));
  EXPECT_THAT(script, ContainsRegex("dashtype 2 [^\n]*'line 8'"));
}

using testing::ElementsAre;
using testing::HasSubstr;
using Json = nlohmann::ordered_json;

Json Report(const std::string& table, const Json& rows) {
  return {{"tables", {{{"name", table}, {"rows", rows}}}}};
}

// What is said of the first question that mentions `part`.
std::string Answer(const Reports& reports, const std::string& part) {
  for (const std::vector<Cell>& row : Summarize(reports).rows) {
    if (row[0].text.find(part) != std::string::npos) return row[2].text;
  }
  return "no such question";
}

TEST(Summary, SaysWhatWasNotMeasured) {
  const ResultTable table = Summarize({});
  ASSERT_FALSE(table.rows.empty());
  for (const std::vector<Cell>& row : table.rows) {
    EXPECT_EQ(row.size(), table.columns.size());
    EXPECT_EQ(row[2].text, "not measured") << row[0].text;
  }
}

TEST(Summary, ComparesWithTheFastestRivalThatReachesTheOptimum) {
  const Json rows = {{{"cameras", 2},
                      {"KROT fast", 1.0},
                      {"fast, 1e-6", 0.5},
                      {"Gugat", 4.0},
                      {"Dai", 3.0},
                      {"FDM (paper)", nullptr}},
                     {{"cameras", 3},
                      {"KROT fast", 1.0},
                      {"fast, 1e-6", 0.5},
                      {"Gugat", 2.0},
                      {"Dai", nullptr}}};
  EXPECT_EQ(Answer({{"triangulation", Report("figure4_ratio", rows)}},
                   "fastest rival"),
            "2.50 (2.00 to 3.00)");
}

TEST(Summary, TakesTheMedianOfTheModelsThatColmapSolved) {
  const Json rows = {{{"ratio", 0.3}, {"gap reached", "yes"}},
                     {{"ratio", nullptr}, {"gap reached", "no"}},
                     {{"ratio", 0.1}, {"gap reached", "yes"}},
                     {{"ratio", 0.05}, {"gap reached", "yes"}}};
  const Reports reports = {{"joint", Report("joint", rows)}};
  EXPECT_EQ(Answer(reports, "colmap"), "0.100 (0.0500 to 0.300)");
  EXPECT_EQ(Answer(reports, "proved"), "3 of 4");
}

TEST(Summary, SpeaksOfTheLargestModelOfEachMethod) {
  const Json rows = {
      {{"method", "res_int"}, {"observations", 10}, {"ratio", 3.0}},
      {{"method", "joint"}, {"observations", 10}, {"ratio", 4.0}},
      {{"method", "res_int"}, {"observations", 99}, {"ratio", 1.25}}};
  EXPECT_EQ(Answer({{"scaling", Report("scaling", rows)}}, "by that at 10^6"),
            "1.25 at 99");
}

TEST(Summary, NamesTheLoadUnderWhichItWasMeasured) {
  Json report = Report("blocks", Json::array());
  report["machine"]["load"] = 2.04;
  EXPECT_THAT(Summarize({{"blocks", report}, {"sweep", report}}).notes,
              ElementsAre(HasSubstr("blocks 2.0, sweep 2.0.")));
}

TEST(Summary, ListsModelsOneByOne) {
  const Json rows = {
      {{"model", "a"}, {"fast", 0.2}, {"gain of 2 threads", 1.9}},
      {{"model", "b"}, {"fast", 0.25}, {"gain of 2 threads", 1.8}}};
  const Reports reports = {{"sweep", Report("sweep", rows)}};
  EXPECT_EQ(Answer(reports, "first ten"), "a 0.200, b 0.250");
  EXPECT_EQ(Answer(reports, "gain of two"), "a 1.90, b 1.80");
}

}  // namespace
}  // namespace krot::internal
