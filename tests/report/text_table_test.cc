#include "krot/report/text_table.h"

#include <cmath>
#include <limits>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "krot/report/reports.h"

namespace krot::internal {
namespace {

TEST(TextTable, AlignsTheFirstColumnLeftAndTheOthersRight) {
  TextTable table;
  table.AddRow({"", "before", "after"});
  table.AddRow({"max error", "10.5", "2"});
  table.AddRow({"note"});
  EXPECT_EQ(table.ToString(),
            "             before  after\n"
            "  max error    10.5      2\n"
            "  note\n");
}

TEST(FormatNumber, ShowsADashForWhatIsNotFinite) {
  EXPECT_EQ(FormatNumber(1.23456, 2), "1.23");
  EXPECT_EQ(FormatNumber(std::nan(""), 2), "-");
  EXPECT_EQ(FormatNumber(std::numeric_limits<double>::infinity(), 2), "-");
}

TEST(Counted, AddsAnSUnlessThereIsOne) {
  EXPECT_EQ(Counted(0, "point"), "0 points");
  EXPECT_EQ(Counted(1, "point"), "1 point");
  EXPECT_EQ(Counted(2, "point"), "2 points");
}

TEST(FormatBytes, ChoosesTheUnit) {
  EXPECT_EQ(FormatBytes(0), "0 B");
  EXPECT_EQ(FormatBytes(999), "999 B");
  EXPECT_EQ(FormatBytes(1500), "1.5 kB");
  EXPECT_EQ(FormatBytes(999949), "999.9 kB");
  EXPECT_EQ(FormatBytes(999950), "1.0 MB");
  EXPECT_EQ(FormatBytes(2000000000000), "2.0 TB");
  EXPECT_EQ(FormatBytes(5000000000000000), "5000.0 TB");
}

std::string TableOfLength(double low, double high) {
  ToleranceReport report;
  ToleranceLength length;
  length.name = "a.jpg to b.jpg";
  length.length = low;
  length.low = {low, low};
  length.high = {high, high};
  report.summary.lengths.push_back(length);
  return ToleranceTable(report, 10);
}

TEST(ToleranceTable, RoundsProvedEndsOutwards) {
  EXPECT_THAT(TableOfLength(1.23456789, 1.23456712),
              ::testing::ContainsRegex("1\\.23456 +1\\.23457 "));
}

TEST(ToleranceTable, LeavesShortNumbersAsTheyAre) {
  EXPECT_THAT(TableOfLength(49.99, 50.01),
              ::testing::ContainsRegex("49\\.99 +50\\.01 "));
}

}  // namespace
}  // namespace krot::internal
