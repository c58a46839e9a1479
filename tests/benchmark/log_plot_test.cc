#include "tools/benchmark/log_plot.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace krot::internal {
namespace {

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

}  // namespace
}  // namespace krot::internal
