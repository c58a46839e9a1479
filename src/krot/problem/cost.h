#pragma once

#include <vector>

#include "krot/minimax/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Observation i as camera coordinates see it: the depth w and v with
// residual ||v||_p / w, in pixels.
struct ViewedPoint {
  double depth;       // w, scene units
  Eigen::Vector2d v;  // pixels times scene units
};

ViewedPoint ViewPoint(const KnownRotationProblem& problem,
                      const Observation& observation, const Estimate& estimate);

// max_i r_i in pixels; infinity if any depth is not positive, 0 if there are
// no observations. O(observations).
double Cost(const KnownRotationProblem& problem, const Estimate& estimate,
            Norm norm, int num_threads);

}  // namespace krot
