#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "krot/math/norm.h"
#include "krot/minimax/residual.h"
#include "krot/problem/cameras.h"
#include "krot/problem/known_rotation_problem.h"

namespace krot {

// Observation i as its camera sees it: the depth w and the v of the residual
// ||v||_p / w.
struct ViewedPoint {
  double depth;       // w, scene units
  Eigen::Vector2d v;  // pixels times scene units
};

inline ViewedPoint ViewPoint(const AffineMap& camera,
                             const Observation& observation,
                             const Eigen::Vector3d& point) {
  const Eigen::Vector3d x_cam = camera.leftCols<3>() * point + camera.col(3);
  const Eigen::Vector3d wv = observation.E * x_cam;
  return {wv[0], wv.tail<2>()};
}
ViewedPoint ViewPoint(const KnownRotationProblem& problem,
                      const Observation& observation, const Estimate& estimate);

// r = ||v||_p / w in pixels; infinity unless w > 0 and r is finite.
inline double ResidualOf(const ViewedPoint& viewed, Norm norm) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  if (!(viewed.depth > 0)) return kInfinity;
  const double residual = NormOf(viewed.v, norm) / viewed.depth;
  return residual < kInfinity ? residual : kInfinity;
}

// Whether every observation has its point in front of the camera, w > 0: where
// the cost is finite. A third of the work of Cost.
bool AllDepthsPositive(const KnownRotationProblem& problem,
                       const Estimate& estimate, int num_threads);

// The median of the depths of all observations, of which there must be one;
// scene units. O(observations).
double MedianDepth(const KnownRotationProblem& problem,
                   const Estimate& estimate);

// The first residual of observations [begin, end) above `level`, or the
// largest if none is; in pixels.
double ResidualAbove(double level, const KnownRotationProblem& problem,
                     const std::vector<AffineMap>& cameras,
                     const std::vector<Eigen::Vector3d>& points, Norm norm,
                     int64_t begin, int64_t end);

// The largest residual of a point, in pixels; 0 without observations.
double PointCost(const KnownRotationProblem& problem, const Estimate& estimate,
                 Norm norm, int64_t point);

// The same of a frame.
double FrameCost(const KnownRotationProblem& problem, const Estimate& estimate,
                 Norm norm, int64_t frame);

// max_i r_i in pixels [Zhang18, (KRot)]; 0 if there are no observations.
// Throws std::invalid_argument unless p >= 1 and the estimate has one
// translation per frame and one point per point. O(observations); the result
// has the same bits at any number of threads.
double Cost(const KnownRotationProblem& problem, const Estimate& estimate,
            Norm norm, int num_threads);

// Whether a cost, pixels, is as good as zero: rounding alone makes as much of
// residuals that are.
inline bool IsZeroUpToRounding(double cost) { return cost < 1e-9; }

}  // namespace krot
