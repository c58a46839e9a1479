#include "tools/benchmark/log_plot.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <sstream>

#include "krot/report/text_table.h"

namespace krot {
namespace {

constexpr double kWidth = 760;
constexpr double kHeight = 460;
constexpr double kLeft = 80;
constexpr double kRight = 190;  // room for the names
constexpr double kTop = 40;
constexpr double kBottom = 55;
constexpr double kNameHeight = 15;  // pixels between two names

constexpr std::array<const char*, 10> kColors = {
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00",
    "#56b4e9", "#000000", "#8c564b", "#7f7f7f", "#b8860b"};

// Decades that hold all values.
struct Axis {
  double low = std::numeric_limits<double>::infinity();  // log10
  double high = -std::numeric_limits<double>::infinity();

  void Include(double value) {
    low = std::min(low, std::log10(value));
    high = std::max(high, std::log10(value));
  }
  double Share(double value) const {
    return (std::log10(value) - low) / (high - low);
  }
};

bool IsShown(const std::pair<double, double>& point) {
  return std::isfinite(point.first) && std::isfinite(point.second) &&
         point.first > 0 && point.second > 0;
}

std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    escaped += c == '&'   ? "&amp;"
               : c == '<' ? "&lt;"
               : c == '>' ? "&gt;"
                          : std::string(1, c);
  }
  return escaped;
}

std::string Number(double value) { return FormatNumber(value, 1); }

std::string TickText(double decade) {
  return FormatNumber(std::pow(10, decade),
                      std::max(0, -static_cast<int>(decade)));
}

class Canvas {
 public:
  explicit Canvas(const LogPlot& plot) : plot_(plot) {
    for (const PlotSeries& series : plot.series) {
      for (const auto& point : series.points) {
        if (!IsShown(point)) continue;
        x_.Include(point.first);
        y_.Include(point.second);
      }
    }
    if (x_.low > x_.high) x_ = y_ = {0, 1};  // nothing to show
    if (x_.high - x_.low < 0.1) x_.high = x_.low + 0.1;
    y_.low = std::floor(y_.low);
    y_.high = std::max(std::ceil(y_.high), y_.low + 1);
  }

  std::string Draw() {
    svg_ << "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 "
         << Number(kWidth) << " " << Number(kHeight)
         << "\" font-family=\"sans-serif\" font-size=\"12\">\n"
         << "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n";
    Text(kLeft, 24, "start", plot_.title, "black");
    Text((kLeft + kWidth - kRight) / 2, kHeight - 14, "middle", plot_.x_label,
         "black");
    svg_ << "<g transform=\"translate(18," << Number(kHeight / 2)
         << ") rotate(-90)\">";
    Text(0, 0, "middle", plot_.y_label, "black");
    svg_ << "</g>\n";
    DrawGrid();
    DrawSeries();
    svg_ << "</svg>\n";
    return svg_.str();
  }

 private:
  double X(double value) const {
    return kLeft + x_.Share(value) * (kWidth - kLeft - kRight);
  }
  double Y(double value) const {
    return kHeight - kBottom - y_.Share(value) * (kHeight - kTop - kBottom);
  }

  void Text(double x, double y, const char* anchor, const std::string& text,
            const char* color) {
    svg_ << "<text x=\"" << Number(x) << "\" y=\"" << Number(y)
         << "\" text-anchor=\"" << anchor << "\" fill=\"" << color << "\">"
         << Escaped(text) << "</text>\n";
  }

  void Line(double x1, double y1, double x2, double y2) {
    svg_ << "<line x1=\"" << Number(x1) << "\" y1=\"" << Number(y1)
         << "\" x2=\"" << Number(x2) << "\" y2=\"" << Number(y2)
         << "\" stroke=\"#dddddd\"/>\n";
  }

  void Dot(double x, double y, const char* color) {
    svg_ << "<circle cx=\"" << Number(x) << "\" cy=\"" << Number(y)
         << "\" r=\"2.5\" fill=\"" << color << "\"/>\n";
  }

  void DrawGrid() {
    for (double decade = y_.low; decade <= y_.high; ++decade) {
      const double y = Y(std::pow(10, decade));
      Line(kLeft, y, kWidth - kRight, y);
      Text(kLeft - 6, y + 4, "end", TickText(decade), "#444444");
    }
    for (const double share : {1.0, 2.0, 5.0}) {
      for (double decade = std::floor(x_.low); decade <= x_.high; ++decade) {
        const double value = share * std::pow(10, decade);
        if (std::log10(value) < x_.low - 1e-9 ||
            std::log10(value) > x_.high + 1e-9) {
          continue;
        }
        Line(X(value), kTop, X(value), kHeight - kBottom);
        Text(X(value), kHeight - kBottom + 16, "middle",
             FormatNumber(value, std::max(0, -static_cast<int>(decade))),
             "#444444");
      }
    }
  }

  // Names go to where the lines end, moved apart from the top downwards.
  void DrawSeries() {
    struct Name {
      double x;
      double y;
      size_t series;
    };
    std::vector<Name> names;
    for (size_t s = 0; s < plot_.series.size(); ++s) {
      std::ostringstream line;
      double last_x = 0;
      double last_y = 0;
      for (const auto& point : plot_.series[s].points) {
        if (!IsShown(point)) continue;
        last_x = X(point.first);
        last_y = Y(point.second);
        line << Number(last_x) << "," << Number(last_y) << " ";
        Dot(last_x, last_y, kColors[s % kColors.size()]);
      }
      if (line.str().empty()) continue;
      svg_ << "<polyline fill=\"none\" stroke-width=\"2\" stroke=\""
           << kColors[s % kColors.size()] << "\" points=\"" << line.str()
           << "\"/>\n";
      names.push_back({last_x, last_y, s});
    }
    std::sort(names.begin(), names.end(),
              [](const Name& a, const Name& b) { return a.y < b.y; });
    double next = 0;
    for (const Name& name : names) {
      const double y = std::max(name.y, next);
      Text(name.x + 6, y + 4, "start", plot_.series[name.series].name,
           kColors[name.series % kColors.size()]);
      next = y + kNameHeight;
    }
  }

  const LogPlot& plot_;
  Axis x_;
  Axis y_;
  std::ostringstream svg_;
};

}  // namespace

std::string ToSvg(const LogPlot& plot) { return Canvas(plot).Draw(); }

}  // namespace krot
