#include "krot/report/reports.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace krot::internal {
namespace {

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
