#include "krot/analysis/error_colors.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "krot/base/check.h"

namespace krot::internal {
namespace {

constexpr std::array<std::array<uint8_t, 3>, 6> kStops = {{{58, 110, 165},
                                                           {53, 151, 143},
                                                           {127, 188, 65},
                                                           {244, 180, 26},
                                                           {230, 85, 13},
                                                           {190, 0, 60}}};
constexpr std::array<uint8_t, 3> kUnknown = {128, 128, 128};

// NaN if none is finite.
double LargestError(const std::vector<double>& errors_px,
                    const Point3D& point) {
  double largest_px = std::numeric_limits<double>::quiet_NaN();
  for (uint64_t e = point.track_begin; e < point.track_end; ++e) {
    if (!std::isfinite(errors_px[e])) continue;
    largest_px = std::fmax(largest_px, errors_px[e]);
  }
  return largest_px;
}

}  // namespace

std::array<uint8_t, 3> ErrorColor(double error_px, double top_px) {
  if (!std::isfinite(error_px)) return kUnknown;
  const double share = std::clamp(error_px / top_px, 0.0, 1.0);
  const double place = share * static_cast<double>(kStops.size() - 1);
  const size_t stop = std::min(kStops.size() - 2, static_cast<size_t>(place));
  const double weight = place - static_cast<double>(stop);
  std::array<uint8_t, 3> color;
  for (size_t i = 0; i < color.size(); ++i) {
    const double low = kStops[stop][i];
    const double high = kStops[stop + 1][i];
    color[i] = static_cast<uint8_t>(std::lround(low + weight * (high - low)));
  }
  return color;
}

void ColorPointsByError(const std::vector<double>& errors_px, double top_px,
                        Model* model) {
  CheckArgument(errors_px.size() == model->track_elements.size(),
                "errors_px.size()", errors_px.size(),
                "the number of track elements");
  CheckArgument(top_px > 0 && std::isfinite(top_px), "top_px", top_px,
                "a positive number");
  for (Point3D& point : model->points3D) {
    point.color = ErrorColor(LargestError(errors_px, point), top_px);
  }
}

}  // namespace krot::internal
