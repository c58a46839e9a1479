#include "tools/benchmark/log_plot.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace krot {
namespace {

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

}  // namespace
}  // namespace krot
