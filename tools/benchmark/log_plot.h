#pragma once

#include <string>
#include <utility>
#include <vector>

namespace krot {

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

// A self-contained SVG image; decades are ruled, each line bears its name at
// its end. Points that are not positive and finite are left out.
std::string ToSvg(const LogPlot& plot);

}  // namespace krot
