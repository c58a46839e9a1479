#include "tools/benchmark/summary.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace krot::internal {
namespace {

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
