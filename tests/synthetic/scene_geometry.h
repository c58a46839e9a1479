#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "krot/model.h"

namespace krot::internal {

// One observation of a scene recomputed from the model alone, with plain
// formulas, so that the tests do not trust the generator.
struct SceneObservation {
  size_t image = 0;  // index in Model::images
  size_t point = 0;  // index in Model::points3D
  double depth = 0;
  Eigen::Vector2d measured;   // pixels
  Eigen::Vector2d projected;  // pixels
  double ErrorPx() const { return (projected - measured).norm(); }
};

// In the order of Model::track_elements. Requires image ids 1, 2, ...
std::vector<SceneObservation> RecomputeObservations(const Model& model);

// The largest ErrorPx().
double MaxErrorPx(const Model& model);

// The smallest depth.
double MinDepth(const Model& model);

}  // namespace krot::internal
