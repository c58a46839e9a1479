#pragma once

#include <Eigen/Core>

#include "krot/minimax/norm.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Observation i as its camera sees it: the depth w and the v of the residual
// ||v||_p / w.
struct ViewedPoint {
  double depth;       // w, scene units
  Eigen::Vector2d v;  // pixels times scene units
};

ViewedPoint ViewPoint(const KnownRotationProblem& problem,
                      const Observation& observation, const Estimate& estimate);

// r = ||v||_p / w in pixels; infinity unless w > 0 and r is finite.
double ResidualOf(const ViewedPoint& viewed, Norm norm);

// max_i r_i in pixels [Zhang18, (KRot)]; 0 if there are no observations.
// Throws std::invalid_argument unless p >= 1 and the estimate has one
// translation per frame and one point per point. O(observations); the result
// has the same bits at any number of threads.
double Cost(const KnownRotationProblem& problem, const Estimate& estimate,
            Norm norm, int num_threads);

}  // namespace krot
