#include "tools/benchmark/log_plot.h"

#include <regex>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace krot {
namespace {

// The y coordinates of the first line.
std::vector<double> LineHeights(const std::string& svg) {
  std::smatch line;
  EXPECT_TRUE(std::regex_search(
      svg, line, std::regex("<polyline[^>]*points=\"([^\"]*)\"")));
  const std::string points = line[1];
  const std::regex pair("([0-9.]+),([0-9.]+)");
  std::vector<double> heights;
  for (std::sregex_iterator it(points.begin(), points.end(), pair), end;
       it != end; ++it) {
    heights.push_back(std::stod((*it)[2]));
  }
  return heights;
}

TEST(LogPlot, PlacesEqualRatiosAtEqualDistances) {
  LogPlot plot;
  plot.series = {{"ours", {{1, 1}, {10, 10}, {100, 100}}}};
  const std::vector<double> heights = LineHeights(ToSvg(plot));
  ASSERT_EQ(heights.size(), 3u);
  EXPECT_LT(heights[1], heights[0]);  // larger values stand higher
  EXPECT_NEAR(heights[0] - heights[1], heights[1] - heights[2], 0.11);
}

TEST(LogPlot, NamesItsLinesAndEscapesThem) {
  LogPlot plot;
  plot.title = "a < b & c";
  plot.series = {{"ours", {{1, 1}}}, {"theirs", {{1, 2}}}};
  const std::string svg = ToSvg(plot);
  EXPECT_THAT(svg, testing::HasSubstr("a &lt; b &amp; c"));
  EXPECT_THAT(svg, testing::HasSubstr(">ours<"));
  EXPECT_THAT(svg, testing::HasSubstr(">theirs<"));
}

TEST(LogPlot, LeavesOutWhatHasNoLogarithm) {
  LogPlot plot;
  plot.series = {{"ours", {{1, 1}, {2, 0}, {3, 5}}}};
  EXPECT_EQ(LineHeights(ToSvg(plot)).size(), 2u);
}

}  // namespace
}  // namespace krot
