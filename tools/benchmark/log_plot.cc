#include "tools/benchmark/log_plot.h"

#include <cmath>
#include <cstdint>
#include <sstream>

namespace krot::internal {
namespace {

bool IsShown(const std::pair<double, double>& point) {
  return std::isfinite(point.first) && std::isfinite(point.second) &&
         point.first > 0 && point.second > 0;
}

// gnuplot repeats its colours after this many lines. Further lines are dashed,
// so that no two lines look the same.
constexpr int64_t kNumColors = 8;

// A string literal for gnuplot, in which nothing is interpreted.
std::string Quoted(const std::string& text) {
  std::string quoted = "'";
  for (const char c : text) quoted += c == '\'' ? "''" : std::string(1, c);
  return quoted + "'";
}

}  // namespace

std::string ToGnuplot(const LogPlot& plot) {
  std::ostringstream script;
  std::ostringstream lines;
  script << "set terminal svg size 760,460 font 'sans-serif,12' "
            "background 'white' noenhanced\n"
         << "set title " << Quoted(plot.title) << "\nset xlabel "
         << Quoted(plot.x_label) << "\nset ylabel " << Quoted(plot.y_label)
         << "\nset logscale xy\nset grid\nset key outside right top\n";
  for (const PlotSeries& series : plot.series) {
    std::ostringstream points;
    for (const auto& point : series.points) {
      if (IsShown(point)) points << point.first << ' ' << point.second << '\n';
    }
    if (points.str().empty()) continue;
    const int64_t index = &series - &plot.series[0];
    const std::string block = "$series" + std::to_string(index);
    script << block << " << EOD\n" << points.str() << "EOD\n";
    lines << (lines.str().empty() ? "plot " : ", \\\n  ") << block
          << " with linespoints linewidth 2 dashtype " << 1 + index / kNumColors
          << " pointtype 7 pointsize 0.4 title " << Quoted(series.name);
  }
  script << lines.str() << '\n';
  return script.str();
}

}  // namespace krot::internal
