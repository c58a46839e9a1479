#pragma once

#include <cstdint>
#include <map>

#include "krot/model.h"

namespace krot::internal {

// How well a model's tracks hold its points.

// Track length -> number of points that have it.
std::map<int64_t, int64_t> TrackLengthHistogram(const Model& model);

// Of all observations whose image has a pose. Zero if there are none.
struct DepthStatistics {
  double min = 0;     // scene units
  double median = 0;  // the lower one of two
  double max = 0;
  int64_t count = 0;
  int64_t not_positive = 0;  // points in or behind the plane of their camera
};
// Requires a valid model. O(observations).
DepthStatistics ComputeDepthStatistics(const Model& model);

// Per point the largest angle between two of its rays, from the point to the
// camera centres: how well its depth is determined. Points with fewer than two
// observations by images with a pose have none.
struct TriangulationAngleStatistics {
  double min_deg = 0;
  double median_deg = 0;  // the lower one of two
  double max_deg = 0;
  int64_t count = 0;  // points that have an angle
};
// Requires a valid model. O(sum of squared track lengths).
TriangulationAngleStatistics ComputeTriangulationAngleStatistics(
    const Model& model, int num_threads = -1);

}  // namespace krot::internal
