#pragma once

#include <string>
#include <utility>
#include <vector>

namespace krot::internal {

struct PlotSeries {
  std::string name;
  std::vector<std::pair<double, double>> points;  // x, y > 0
};

// Lines over logarithmic axes.
struct LogPlot {
  std::string title;
  std::string x_label;
  std::string y_label;
  std::vector<PlotSeries> series;
};

// A script for gnuplot that contains the data and prints an SVG image. Points
// that are not positive and finite are left out, and so are lines without any
// points.
std::string ToGnuplot(const LogPlot& plot);

}  // namespace krot::internal
